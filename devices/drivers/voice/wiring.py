"""The voice key: its driver on PortAudio, and a simulated microphone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from visavis.devices.byte_links import ByteLink, MemoryLink
from visavis.devices.contracts import Device, Hand
from visavis.devices.drivers.buttons.keyboard import KeyLink
from visavis.devices.drivers.voice.beside_keys import VoiceAndKeyboard
from visavis.devices.drivers.voice.driver import VoiceKey
from visavis.devices.drivers.voice.spec import (
    VOICE,
    VOICE_AND_KEYBOARD,
    VOICE_KEY,
    VoiceAndKeyboardOptions,
    VoiceKeyOptions,
)
from visavis.devices.sim.buttons.keyboard import PressedKeys
from visavis.devices.sim.buttons.two_hands import part_presses
from visavis.devices.sim.microphone import SimulatedMicrophone
from visavis.devices.sync.audio import sound_library
from visavis.devices.wiring import Site, Wiring

Load = Callable[[], Any]
"""Returns sounddevice, or a stand-in."""


@dataclass(frozen=True)
class SimulatedLibrary:
    """Load a simulated microphone instead of sounddevice."""

    site: Site[VoiceKeyOptions] | Site[VoiceAndKeyboardOptions]
    mouth: Hand | None = None

    def __call__(self) -> SimulatedMicrophone:
        """Return the library of a simulated microphone."""
        site, options = self.site, self.site.options
        return SimulatedMicrophone(
            site.clock,
            site.watched,
            faults=site.faults,
            latency_ms=options.latency_ms,
            drift_ppm=options.drift_ppm,
            seed=site.own_seed,
            mouth=self.mouth,
        )


def _make(site: Site[VoiceKeyOptions], load: Load) -> Device:
    return VoiceKey(
        site.role,
        load,
        site.clock,
        spec=site.spec,
        options=site.options,
        is_simulated=isinstance(load, SimulatedLibrary),
    )


def _real(site: Site[VoiceKeyOptions]) -> Load:
    return sound_library


@dataclass(frozen=True)
class LoadAndLink:
    """What a microphone and a window are reached by."""

    load: Load
    link: ByteLink
    is_simulated: bool


def _make_both(site: Site[VoiceAndKeyboardOptions], wire: LoadAndLink) -> Device:
    return VoiceAndKeyboard(
        site.role,
        wire.load,
        wire.link,
        site.clock,
        spec=site.spec,
        options=site.options,
        is_simulated=wire.is_simulated,
    )


def _real_both(site: Site[VoiceAndKeyboardOptions]) -> LoadAndLink:
    return LoadAndLink(sound_library, KeyLink(site.clock), is_simulated=False)


def _simulated_both(site: Site[VoiceAndKeyboardOptions]) -> LoadAndLink:
    mouth, hand = part_presses(site.watched, VOICE)
    names = {control: key for key, control in site.options.keys.items()}
    link = MemoryLink(PressedKeys(hand, site.clock, None, names), site.clock)
    return LoadAndLink(SimulatedLibrary(site, mouth), link, is_simulated=True)


WIRINGS = (
    Wiring[VoiceKeyOptions, Load](VOICE_KEY, make=_make, real=_real, simulated=SimulatedLibrary),
    Wiring[VoiceAndKeyboardOptions, LoadAndLink](
        VOICE_AND_KEYBOARD, make=_make_both, real=_real_both, simulated=_simulated_both
    ),
)
