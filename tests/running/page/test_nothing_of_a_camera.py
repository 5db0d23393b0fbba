"""Pictures and films leave by pages without what their camera wrote: place, owner, device."""

from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, PngImagePlugin
from PIL import Image as Files

from visavis.lab.errors import DesignError
from visavis.running.picture_store import PictureStore
from visavis.stimuli.flat import Image

MARK = b"MARKOFCAMERA"
ICC = MARK * 40


def with_marks(path: Path) -> None:
    """Write a picture with a mark wherever its format takes one."""
    shades = np.random.default_rng(1).integers(0, 255, (8, 6, 3), dtype=np.uint8)
    picture, exif = Files.fromarray(shades), Files.Exif()
    exif[ExifTags.Base.Make] = exif[ExifTags.Base.Artist] = MARK.decode()
    if path.suffix == ".tif":
        picture.save(path, tiffinfo={270: MARK.decode(), 315: MARK.decode()}, icc_profile=ICC)
        return
    exif[ExifTags.Base.Orientation] = 6
    exif.get_ifd(ExifTags.IFD.GPSInfo)[ExifTags.GPS.GPSMapDatum] = MARK.decode()
    if path.suffix == ".png":
        text = PngImagePlugin.PngInfo()
        text.add_text("Author", MARK.decode())
        text.add_itxt("XML:com.adobe.xmp", f"<x>{MARK.decode()}</x>")
        picture.save(path, exif=exif, pnginfo=text, icc_profile=ICC)
    else:
        picture.save(path, exif=exif, xmp=MARK, comment=MARK, icc_profile=ICC)


@pytest.mark.parametrize("ending", ["png", "jpg", "webp", "tif"])
def test_a_picture_on_a_page_is_its_pixels_alone(tmp_path: Path, ending: str) -> None:
    name = f"a.{ending}"
    with_marks(tmp_path / name)
    assert MARK in (tmp_path / name).read_bytes() or ending == "png"
    store = PictureStore([], tmp_path)
    picture = store.describe(Image(name, width_deg=3))["picture"]
    data, at, kinds = store.assets[picture], 8, set()
    while at < len(data):
        kinds.add(data[at + 4 : at + 8])
        at += 12 + int.from_bytes(data[at : at + 4], "big")
    assert {b"IHDR", b"IDAT", b"IEND"} == kinds


def test_a_film_that_names_its_place_is_not_given_to_pages(tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    from visavis.stimuli.film_file import kind_for_browsers

    with av.open(str(tmp_path / "a.mp4"), "w") as file:
        file.metadata["location"] = "+48.8584+002.2945/"
        stream = file.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for _ in range(6):
            frame = av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8), format="rgb24")
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
    with pytest.raises(DesignError, match=r"where it was filmed.*-map_metadata -1"):
        kind_for_browsers(tmp_path / "a.mp4")
