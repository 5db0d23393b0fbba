"""The images of a simulated OpenXR runtime: swap chains, layers, and the images shown.

Textures are made in the context that is current when a swap chain is created, which is the
program's own. Every image that a frame ends with is read back from the card once, as the compositor
would sample it. Not modelled: distortion, depth, layers other than one projection, times before
which an image is still in use.
"""

# ruff: noqa: N802 - the functions bear the names of OpenXR

import ctypes
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.devices.current_gl import SRGB8_ALPHA8, GlContext, current_context, is_current
from visavis.devices.drivers.openxr.graphics import BINDING_TYPES
from visavis.devices.sim.image_reader import ImageReader

SUCCESS, TIMEOUT_EXPIRED = 0, 1
CALL_ORDER_INVALID, LAYER_INVALID, RECT_INVALID = -37, -23, -25
FORMAT_UNSUPPORTED, REQUIREMENTS_CALL_MISSING, GRAPHICS_DEVICE_INVALID = -26, -50, -38
PROJECTION, OPENGL_IMAGES = 35, 3
OFFERED_FORMATS = (SRGB8_ALPHA8, 0x881A)


@dataclass(frozen=True, eq=False)
class ShownEye:
    """One eye of a frame as handed over: the image (height, width, 4), top row first, the place
    and orientation (w, x, y, z) it was drawn from, and its angles left, right, down, up.
    """

    image: npt.NDArray[np.uint8]
    position_m: tuple[float, ...]
    orientation_wxyz: tuple[float, ...]
    angles_rad: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class ShownFrame:
    """A frame that ended with images, for the display time (XrTime) it named."""

    display_time: int
    eyes: tuple[ShownEye, ShownEye]


@dataclass
class _Chain:
    textures: list[int]
    size_px: tuple[int, int]
    context: GlContext
    acquired_indices: deque[int] = field(default_factory=deque)
    has_waited: bool = False
    following: int = 0
    released: int | None = None
    image: npt.NDArray[np.uint8] | None = None


class SimulatedImages:
    """The functions of a runtime that concern images; `forced_error` answers the end of a frame."""

    def __init__(self, new_handle: Callable[[Any], int]) -> None:
        self.on_frame: Callable[[ShownFrame], None] | None = None
        self.forced_error = 0
        self.frames_shown = 0
        self._new_handle = new_handle
        self._reader = ImageReader()
        self._chains: dict[int, _Chain] = {}
        self._asked_requirements = False

    def session_result(self, link: int | None) -> int:
        """Return the result of creating a session with these graphics."""
        if not link:
            return GRAPHICS_DEVICE_INVALID
        kind = ctypes.cast(link, ctypes.POINTER(ctypes.c_int32))[0]
        if kind not in BINDING_TYPES.values():
            return GRAPHICS_DEVICE_INVALID
        return SUCCESS if self._asked_requirements else REQUIREMENTS_CALL_MISSING

    def forget(self) -> None:
        """Free every swap chain, as at the end of a session."""
        for chain in list(self._chains):
            self._free(chain)
        self._asked_requirements = False

    def layers_result(self, info: Any) -> int:
        """Check the layers of a frame; show them, or return the error."""
        if self.forced_error:
            return self.forced_error
        if info.layer_count == 0:
            return SUCCESS
        raw = ctypes.cast(info._layers, ctypes.POINTER(ctypes.c_void_p))[0]  # noqa: SLF001 - the package's field
        if ctypes.cast(raw, ctypes.POINTER(ctypes.c_int32))[0] != PROJECTION:
            return LAYER_INVALID
        import xr

        layer = ctypes.cast(raw, ctypes.POINTER(xr.CompositionLayerProjection)).contents
        if layer.view_count != 2:
            return LAYER_INVALID
        eyes = []
        for eye in range(2):
            view = layer._views[eye]  # noqa: SLF001 - the package's field
            chain = self._chains.get(_handle(view.sub_image.swapchain))
            if chain is None or chain.released is None:
                return LAYER_INVALID
            extent = view.sub_image.image_rect.extent
            if (extent.width, extent.height) != chain.size_px:
                return RECT_INVALID
            pose, fov = view.pose, view.fov
            p, q = pose.position, pose.orientation
            if chain.image is None:
                chain.image = self._reader.read(chain.textures[chain.released])
            eyes.append(
                ShownEye(
                    chain.image,
                    (p.x, p.y, p.z),
                    (q.w, q.x, q.y, q.z),
                    (fov.angle_left, fov.angle_right, fov.angle_down, fov.angle_up),
                )
            )
        self.frames_shown += 1
        if self.on_frame is not None:
            self.on_frame(ShownFrame(int(info.display_time), (eyes[0], eyes[1])))
        return SUCCESS

    def _free(self, handle: int) -> None:
        """Free a swap chain; a genuine runtime does it in the program's context, or crashes."""
        chain = self._chains.pop(handle)
        if not is_current(chain.context):
            raise AssertionError("a swap chain was freed when the context of its images was gone")
        self._reader.copies.delete(chain.textures)

    # ---- the runtime's functions -------------------------------------------------------------

    def _xr_GetOpenGLGraphicsRequirementsKHR(
        self, instance: Any, system: Any, requirements: Any
    ) -> int:
        self._asked_requirements = True
        return SUCCESS

    def _xr_EnumerateSwapchainFormats(
        self, session: Any, capacity: int, count: Any, formats: Any
    ) -> int:
        count[0] = len(OFFERED_FORMATS)
        if capacity and formats:
            for i, name in enumerate(OFFERED_FORMATS):
                formats[i] = name
        return SUCCESS

    def _xr_CreateSwapchain(self, session: Any, info: Any, chain: Any) -> int:
        create_info = info.contents
        if int(create_info.format) not in OFFERED_FORMATS:
            return FORMAT_UNSUPPORTED
        size = (int(create_info.width), int(create_info.height))
        copies = self._reader.copies
        textures = [copies.texture(size, int(create_info.format)) for _ in range(OPENGL_IMAGES)]
        self._chains[self._new_handle(chain)] = _Chain(textures, size, current_context())
        return SUCCESS

    def _xr_DestroySwapchain(self, chain: Any) -> int:
        if _handle(chain) in self._chains:
            self._free(_handle(chain))
        return SUCCESS

    def _xr_EnumerateSwapchainImages(
        self, chain: Any, capacity: int, count: Any, images: Any
    ) -> int:
        import xr

        textures = self._chains[_handle(chain)].textures
        count[0] = len(textures)
        if capacity and images:
            image_structs = ctypes.cast(images, ctypes.POINTER(xr.SwapchainImageOpenGLKHR))
            for i, name in enumerate(textures):
                image_structs[i].image = name
        return SUCCESS

    def _xr_AcquireSwapchainImage(self, chain: Any, info: Any, index: Any) -> int:
        swapchain = self._chains[_handle(chain)]
        if len(swapchain.acquired_indices) == len(swapchain.textures):
            return CALL_ORDER_INVALID
        swapchain.acquired_indices.append(swapchain.following)
        index[0] = swapchain.following
        swapchain.following = (swapchain.following + 1) % len(swapchain.textures)
        return SUCCESS

    def _xr_WaitSwapchainImage(self, chain: Any, info: Any) -> int:
        swapchain = self._chains[_handle(chain)]
        if not swapchain.acquired_indices or swapchain.has_waited:
            return CALL_ORDER_INVALID
        swapchain.has_waited = True
        return SUCCESS

    def _xr_ReleaseSwapchainImage(self, chain: Any, info: Any) -> int:
        swapchain = self._chains[_handle(chain)]
        if not swapchain.has_waited:
            return CALL_ORDER_INVALID
        swapchain.has_waited, swapchain.released = False, swapchain.acquired_indices.popleft()
        swapchain.image = None
        return SUCCESS


def _handle(handle: Any) -> int:
    return int(ctypes.cast(handle, ctypes.c_void_p).value or 0)
