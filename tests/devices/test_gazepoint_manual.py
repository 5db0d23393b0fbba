"""Every example of "Open Gaze API by Gazepoint" (revised March 11, 2025) that concerns the driver.

Each case names the chapter it stands in. Commands and answers are the document's own, letter by
letter; lines that it breaks for the page are joined.
"""

from itertools import pairwise

import pytest

from tests.devices.gaze_rigs import GazeRig
from visavis.devices.drivers.gazepoint import codec
from visavis.devices.drivers.gazepoint.driver import Gazepoint
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.sim.gazepoint import GazepointSimulator

PLACE = codec.Place(Screen(500.0, 300.0, 600.0))
CALIBRATION = (  # chapter 4.3
    '<CAL ID="CALIB_RESULT" CALX1="0.50000" CALY1="0.50000" LX1="0.50229" LY1="0.50279" LV1="1" '
    'RX1="0.51467" RY1="0.50870" RV1="1" CALX2="0.85000" CALY2="0.15000" LX2="0.84943" '
    'LY2="0.14930" LV2="1" RX2="0.84600" RY2="0.14763" RV2="1" CALX3="0.85000" CALY3="0.85000" '
    'LX3="0.84942" LY3="0.84929" LV3="1" RX3="0.84627" RY3="0.84779" RV3="1" CALX4="0.15000" '
    'CALY4="0.85000" LX4="0.14943" LY4="0.84930" LV4="1" RX4="0.14616" RY4="0.84772" RV4="1" '
    'CALX5="0.15000" CALY5="0.15000" LX5="0.14944" LY5="0.14931" LV5="1" RX5="0.14689" '
    'RY5="0.14815" RV5="1" />'
)


def line_of(text):
    (line,) = codec.LineReader().feed(f"{text}\r\n".encode())
    return line


@pytest.mark.parametrize(
    ("chapter", "command", "text"),
    [
        (
            "3.1",
            codec.set_line("ENABLE_SEND_DATA", STATE="1"),
            '<SET ID="ENABLE_SEND_DATA" STATE="1" />',
        ),
        (
            "3.2",
            codec.set_line("ENABLE_SEND_COUNTER", STATE="1"),
            '<SET ID="ENABLE_SEND_COUNTER" STATE="1" />',
        ),
        (
            "3.4",
            codec.set_line("CALIBRATE_SHOW", STATE="1"),
            '<SET ID="CALIBRATE_SHOW" STATE="1" />',
        ),
        (
            "3.11",
            codec.set_line("USER_DATA", VALUE="TEST1"),
            '<SET ID="USER_DATA" VALUE="TEST1" />',
        ),
        ("3.13", codec.get_line("TIME_TICK_FREQUENCY"), '<GET ID="TIME_TICK_FREQUENCY" />'),
        ("3.16", codec.get_line("PRODUCT_ID"), '<GET ID="PRODUCT_ID" />'),
        ("3.19", codec.get_line("API_ID"), '<GET ID="API_ID" />'),
    ],
)
def test_commands_are_written_as_in_the_document(chapter, command, text):
    assert command == f"{text}\r\n".encode()


@pytest.mark.parametrize(
    ("chapter", "text", "tag", "values"),
    [
        (
            "3.1",
            '<ACK ID="ENABLE_SEND_DATA" STATE="1" />',
            "ACK",
            {"ID": "ENABLE_SEND_DATA", "STATE": "1"},
        ),
        (
            "3.16",
            '<ACK ID="PRODUCT_ID" VALUE="GP3" BUS="USB2" RATE="60" />',
            "ACK",
            {"ID": "PRODUCT_ID", "VALUE": "GP3", "BUS": "USB2", "RATE": "60"},
        ),
        (
            "3.17",
            '<ACK ID="SERIAL_ID" VALUE="123456789" />',
            "ACK",
            {"ID": "SERIAL_ID", "VALUE": "123456789"},
        ),
        ("3.19", '<ACK ID="API_ID" VALUE="2.4" />', "ACK", {"ID": "API_ID", "VALUE": "2.4"}),
        (
            "3.20",
            '<ACK ID="TRACKER_ID" ACTIVE_ID="1" MAX_ID="2" SEARCH="NONE" />',
            "ACK",
            {"ID": "TRACKER_ID", "ACTIVE_ID": "1", "MAX_ID": "2", "SEARCH": "NONE"},
        ),
        (
            "4.1",
            '<CAL ID="CALIB_START_PT" PT="1" CALX="0.5000" CALY="0.5000" />',
            "CAL",
            {"ID": "CALIB_START_PT", "PT": "1", "CALX": "0.5000", "CALY": "0.5000"},
        ),
        ("5.1", '<REC CNT="1484" />', "REC", {"CNT": "1484"}),
        ("5.24", '<REC USER="TRIG1" />', "REC", {"USER": "TRIG1"}),
        (
            "6",
            '<UPDATE ACTIVE_ID="1" MAX_ID="2" X="0" Y="0" WIDTH="1920" HEIGHT="1080" >',
            "UPDATE",
            {
                "ACTIVE_ID": "1",
                "MAX_ID": "2",
                "X": "0",
                "Y": "0",
                "WIDTH": "1920",
                "HEIGHT": "1080",
            },
        ),
    ],
)
def test_answers_are_read_as_in_the_document(chapter, text, tag, values):
    line = line_of(text)

    assert (line.tag, dict(line.values)) == (tag, values)


def test_tick_frequency_of_chapter_3_13_is_the_pattern_of_a_double():
    line = line_of('<ACK ID="TIME_TICK_FREQUENCY" FREQ="4704405731611246592" />')

    assert codec.tick_frequency(line.values["FREQ"]) == 3_330_093.0


def test_times_of_chapter_5_2_are_one_sixtieth_of_a_second_apart():
    texts = [f'<REC TIME="{t}" />' for t in ("4.99716", "5.01366", "5.02991", "5.04653")]
    stamps = [codec.device_ns(line_of(text).values, 0.0) for text in texts]

    assert stamps[0] == 4_997_160_000
    steps = [b - a for a, b in pairwise(stamps)]
    assert steps == pytest.approx([1e9 / 60] * 3, rel=0.03)


def test_ticks_of_chapter_5_3_are_taken_whole():
    texts = [f'<REC TIME_TICK="{n}" />' for n in (2096547271623, 2096547490186, 2096547654197)]
    stamps = [codec.device_ns(line_of(text).values, 1e9) for text in texts]

    assert stamps == [2096547271623, 2096547490186, 2096547654197]


def test_eyes_of_chapters_5_11_and_5_12_are_metres_and_pupils_too():
    text = (
        '<REC TIME="1.0" LPOGX="0.5" LPOGY="0.5" LPOGV="1" RPOGX="0.5" RPOGY="0.5" RPOGV="1" '
        'LEYEX="-0.04796" LEYEY="0.00305" LEYEZ="0.69235" LPUPILD="0.00210" LPUPILV="1" '
        'REYEX="0.04321" REYEY="0.00213" REYEZ="0.66543" RPUPILD="0.00240" RPUPILV="1" />'
    )
    sample = codec.decode_record(line_of(text).values, PLACE, 0.0)
    row = rows_to_values([sample.row])[0]

    assert (row["left_pupil_mm"], row["right_pupil_mm"]) == pytest.approx((2.1, 2.4))
    # camera 0.18 m below the screen's centre; the middle between the eyes, 0.6 m from the screen
    assert row["origin_m"] == pytest.approx((-0.002375, -0.17741, 0.07889), abs=1e-5)


def test_calibration_of_chapter_4_3_has_five_points_and_errors_of_a_fraction_of_a_degree():
    errors_deg, points = codec.calibration_errors_deg(line_of(CALIBRATION).values, PLACE.screen)

    assert points == 5
    assert len(errors_deg) == 10
    assert max(errors_deg) == pytest.approx(0.74, abs=0.01)  # right eye, first point
    assert min(errors_deg) < 0.05


class ManualServer(GazepointSimulator):
    """Answers as the document prints it, for one tracker."""

    def _get(self, name, t_ns):
        answers = {
            "API_ID": '<ACK ID="API_ID" VALUE="2.4" />',
            "PRODUCT_ID": '<ACK ID="PRODUCT_ID" VALUE="GP3" BUS="USB2" RATE="60" />',
            "SERIAL_ID": '<ACK ID="SERIAL_ID" VALUE="123456789" />',
            "TIME_TICK_FREQUENCY": ('<ACK ID="TIME_TICK_FREQUENCY" FREQ="4704405731611246592" />'),
        }
        return answers.get(name) or super()._get(name, t_ns)


def test_server_that_answers_with_the_documents_examples_is_driven():
    rig = GazeRig(Gazepoint, ManualServer, ticks_per_s=3_330_093).start().run(5.0)

    assert (rig.driver.info.model, rig.driver.info.serial) == ("GP3", "123456789")
    assert rig.stamps("t_device_ns")[-1] - rig.stamps("t_device_ns")[0] == pytest.approx(
        5e9, rel=0.02
    )
    assert rig.messages() == ""
