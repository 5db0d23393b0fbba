"""Show images through an OpenXR session: bind it to OpenGL, keep a swap chain for each eye.

Images are copied as they are, sRGB bytes into an sRGB swap chain, within the context that drew
them. Source: the OpenXR specification, XR_KHR_opengl_enable, XR_MNDX_egl_enable and
XR_KHR_visibility_mask.
"""

import ctypes
import ctypes.util
import math
import struct
from collections.abc import Iterable, Sequence
from typing import Any

from visavis.devices.current_gl import (
    SRGB8_ALPHA8,
    GlContext,
    GlCopies,
    current_context,
    is_current,
)
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DeviceNotFound
from visavis.lab.frame import EyeView

OPENGL = "XR_KHR_opengl_enable"
EGL = "XR_MNDX_egl_enable"
VISIBILITY_MASK = "XR_KHR_visibility_mask"
BINDING_TYPES = {"egl": 1000048004, "glx": 1000023001, "wgl": 1000023000}
"""`XrStructureType` of the bindings."""

IMAGE_PAIR = struct.Struct("<4I 22f")
"""Names of the two textures (left first), width, height; then per eye the place it was drawn
from, its orientation (x, y, z, w), and the angles left, right, down, up."""

IMAGE_TIMEOUT_NS = NS_PER_S

_p = ctypes.c_void_p


_HEADER: tuple[tuple[str, Any], ...] = (("type", ctypes.c_int32), ("next", _p))


class _Egl(ctypes.Structure):
    _fields_ = (
        *_HEADER,
        ("get_proc_address", _p),
        ("display", _p),
        ("config", _p),
        ("context", _p),
    )


class _Xlib(ctypes.Structure):
    _fields_ = (
        *_HEADER,
        ("display", _p),
        ("visual", ctypes.c_uint32),
        ("config", _p),
        ("drawable", ctypes.c_ulong),
        ("context", _p),
    )


class _Windows(ctypes.Structure):
    _fields_ = (*_HEADER, ("display", _p), ("context", _p))


class GraphicsBinding:
    """The current OpenGL context, in the form with which a session is created.

    Raises:
        DeviceNotFound: the runtime cannot take this kind of context.
        DeviceError: no context is current.
    """

    def __init__(self, offered_extensions: Iterable[str]) -> None:
        self.context = current_context()
        self.extensions = (OPENGL, EGL) if self.context.system == "egl" else (OPENGL,)
        missing = [name for name in self.extensions if name not in offered_extensions]
        if missing:
            raise DeviceNotFound(
                f"the OpenXR runtime does not offer {', '.join(missing)}, so it shows no images "
                "drawn with OpenGL here",
                remedy="use SteamVR or Monado as the OpenXR runtime, on an X11 desktop if it is "
                "Linux; or the driver openvr_headset",
            )
        self._binding_struct = _binding(self.context)

    @property
    def link(self) -> ctypes.c_void_p:
        """Pointer for the session's create info; valid as long as this object lives."""
        return ctypes.cast(ctypes.pointer(self._binding_struct), _p)


def _binding(context: GlContext) -> ctypes.Structure:
    kind = BINDING_TYPES[context.system]
    if context.system == "egl":
        egl = ctypes.CDLL(ctypes.util.find_library("EGL") or "libEGL.so.1")
        finder = ctypes.cast(egl.eglGetProcAddress, _p).value
        return _Egl(kind, None, finder, context.display, context.config, context.context)
    if context.system == "glx":
        return _Xlib(
            kind,
            None,
            context.display,
            context.visual,
            context.config,
            context.drawable,
            context.context,
        )
    return _Windows(kind, None, context.display, context.context)


def ask_graphics_requirements(xr: Any, instance: Any, system: Any) -> None:
    """Ask for the OpenGL version; the specification requires this before a session."""
    name = "xrGetOpenGLGraphicsRequirementsKHR"
    function = ctypes.cast(
        xr.get_instance_proc_addr(instance, name), xr.PFN_xrGetOpenGLGraphicsRequirementsKHR
    )
    requirements = xr.GraphicsRequirementsOpenGLKHR()
    problem = xr.check_result(xr.Result(function(instance, system, ctypes.byref(requirements))))
    if problem.is_exception():
        raise problem


def hidden_area(xr: Any, ask: Any, session: Any, eye: int) -> list[tuple[float, float]]:
    """Return the corners of the area that the lens hides from a view, three per triangle.

    Corners are tangents to the right and up, from the runtime's `xrGetVisibilityMaskKHR`; empty
    where nothing is hidden.
    """
    kind = xr.ViewConfigurationType.PRIMARY_STEREO.value
    mask_type = xr.VisibilityMaskTypeKHR.HIDDEN_TRIANGLE_MESH.value
    mask = xr.VisibilityMaskKHR()

    def fill_mask() -> None:
        problem = xr.check_result(xr.Result(ask(session, kind, eye, mask_type, ctypes.byref(mask))))
        if problem.is_exception():
            raise problem

    fill_mask()
    vertices = (xr.Vector2f * mask.vertex_count_output)()
    indices = (ctypes.c_uint32 * mask.index_count_output)()
    if not len(vertices) or not len(indices):
        return []
    mask.vertices, mask.vertex_capacity_input = vertices, len(vertices)
    mask.indices, mask.index_capacity_input = indices, len(indices)
    fill_mask()
    return [(float(vertices[i].x), float(vertices[i].y)) for i in indices if i < len(vertices)]


def packed_images(
    names: Sequence[int],
    size_px: tuple[int, int],
    poses: Sequence[tuple[Sequence[float], Sequence[float]]],
    views: Sequence[EyeView],
) -> bytes:
    """Return `IMAGE_PAIR` of two images; `poses` are place and orientation (w, x, y, z) per eye."""
    numbers: list[float] = []
    for (place, (w, x, y, z)), view in zip(poses, views, strict=True):
        bounds = (view.tangent_left, view.tangent_right, view.tangent_bottom, view.tangent_top)
        numbers += [*place, x, y, z, w, *(math.atan(tangent) for tangent in bounds)]
    return IMAGE_PAIR.pack(*names, *size_px, *numbers)


class EyeImages:
    """A swap chain per eye, made when the first images come, and the layer that shows them."""

    def __init__(self, xr: Any, session: Any, space: Any) -> None:
        self._xr = xr
        self._session = session
        self._space = space
        self._context = current_context()
        self._copies = GlCopies()
        self._size_px = (0, 0)
        self._chains: list[tuple[Any, list[int]]] = []
        self._layer: Any = None

    @property
    def layers(self) -> list[Any]:
        """Layers to end a frame with: the last images, or none before the first."""
        return [] if self._layer is None else [ctypes.pointer(self._layer)]

    def take(self, raw: bytes) -> str:
        """Copy two images and make them the layer; return what went wrong, or nothing."""
        left, right, width, height, *numbers = IMAGE_PAIR.unpack(raw)
        if (width, height) != self._size_px:
            problem = self._make_chains((width, height))
            if problem:
                return problem
        xr, views = self._xr, []
        for eye, name in enumerate((left, right)):
            chain, textures = self._chains[eye]
            index = int(xr.acquire_swapchain_image(chain, xr.SwapchainImageAcquireInfo()))
            try:
                xr.wait_swapchain_image(chain, xr.SwapchainImageWaitInfo(timeout=IMAGE_TIMEOUT_NS))
                problem = self._copies.copy(name, textures[index], (width, height))
            finally:
                xr.release_swapchain_image(chain, xr.SwapchainImageReleaseInfo())
            if problem:
                return f"the {('left', 'right')[eye]} image: {problem}"
            x, y, z, i, j, k, w, *angles = numbers[11 * eye : 11 * (eye + 1)]
            down, up = angles[2:]
            views.append(
                xr.CompositionLayerProjectionView(
                    pose=xr.Posef(xr.Quaternionf(i, j, k, w), xr.Vector3f(x, y, z)),
                    fov=xr.Fovf(angles[0], angles[1], up, down),
                    sub_image=xr.SwapchainSubImage(
                        swapchain=chain,
                        image_rect=xr.Rect2Di(xr.Offset2Di(0, 0), xr.Extent2Di(width, height)),
                    ),
                )
            )
        self._layer = xr.CompositionLayerProjection(space=self._space, views=views)
        return ""

    def close(self) -> bool:
        """Release the swap chains; the session may be gone already.

        Return whether that was possible: the runtime frees their textures in the context in which
        the session began, and where that is gone it would take the process with it.
        """
        self._layer = None
        if not is_current(self._context):
            return False
        for chain, _ in self._chains:
            try:
                self._xr.destroy_swapchain(chain)
            except self._xr.exception.XrException:  # it ended with its session
                continue
        self._chains = []
        self._copies.close()
        return True

    def _make_chains(self, size_px: tuple[int, int]) -> str:
        xr = self._xr
        formats = [int(f) for f in xr.enumerate_swapchain_formats(self._session)]
        if SRGB8_ALPHA8 not in formats:
            return "the runtime offers no swap chains of sRGB bytes"
        self._layer = None
        for chain, _ in self._chains:
            xr.destroy_swapchain(chain)
        self._chains = []
        usage = xr.SwapchainUsageFlags
        for _ in range(2):
            chain = xr.create_swapchain(
                self._session,
                xr.SwapchainCreateInfo(
                    usage_flags=usage.COLOR_ATTACHMENT_BIT
                    | usage.SAMPLED_BIT
                    | usage.TRANSFER_DST_BIT,
                    format=SRGB8_ALPHA8,
                    sample_count=1,
                    width=size_px[0],
                    height=size_px[1],
                    face_count=1,
                    array_size=1,
                    mip_count=1,
                ),
            )
            images = xr.enumerate_swapchain_images(chain, xr.SwapchainImageOpenGLKHR)
            self._chains.append((chain, [int(image.image) for image in images]))
        self._size_px = size_px
        return ""
