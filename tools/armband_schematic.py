"""Draw the armband's schematic: `python -m tools.armband_schematic` writes docs/armband.svg.

The source of the drawing is this file; parts and values are those of docs/armbands.md.
"""

from pathlib import Path

import schemdraw
from schemdraw import elements

TARGET = Path(__file__).resolve().parents[1] / "docs" / "armband.svg"
PIN = elements.IcPin


def draw() -> schemdraw.Drawing:
    """Return the drawing: supply, one of four motor channels, processor with what hangs on it."""
    schemdraw.use("svg")
    drawing = schemdraw.Drawing(show=False, fontsize=11, unit=2.4)
    _supply(drawing)
    _channel(drawing)
    _processor(drawing)
    return drawing


def _supply(drawing: schemdraw.Drawing) -> None:
    drawing += elements.Label().at((0, 4.4)).label("Supply", fontsize=15, halign="left")
    cell = elements.BatteryCell().at((0, 0)).up().reverse()
    drawing += cell
    drawing += elements.Label().at((-1.5, 1.2)).label("BT1\nLi-ion 3.7 V\nprotected")
    drawing += elements.Fuse().at(cell.end).right().label("F1  1 A", "bottom")
    drawing += elements.Switch().right().label("S1", "bottom")
    drawing += (split := elements.Dot().label("BAT", "top"))
    drawing += elements.Line().right().length(1.6)
    drawing += (motors := elements.VoltageRegulator().anchor("in").label("U2  3.3 V, 1 A", "top"))
    drawing += elements.Ground().at(motors.gnd)
    drawing += elements.Line().at(motors.out).right().length(1.2)
    drawing += (rail := elements.Dot().label("VM (motors)", "top"))
    drawing += elements.Capacitor(polar=True).at(rail.center).down().label("C3  470 µF", "bottom")
    drawing += elements.Ground()
    drawing += elements.Line().at(rail.center).right().length(2.6)
    drawing += (sense := elements.Dot())
    drawing += elements.Resistor().at(sense.center).down().length(1.9).label("R3  300k", "bottom")
    drawing += (tap := elements.Dot())
    drawing += elements.Line().at(tap.center).right().length(0.7).label("ADC1", "right")
    drawing += (
        elements.Resistor().at(tap.center).down().length(1.9).label("R4  100k\n‖ 100 nF", "bottom")
    )
    drawing += elements.Ground()
    drawing += elements.Resistor().at(split.center).down().length(1.9).label("R1  300k", "bottom")
    drawing += (low := elements.Dot())
    drawing += elements.Line().at(low.center).left().length(0.7).label("ADC0", "left")
    drawing += (
        elements.Resistor().at(low.center).down().length(1.9).label("R2  100k ‖ 100 nF", "bottom")
    )
    drawing += elements.Ground()
    drawing += elements.Ground().at(cell.start)
    drawing += (
        elements.Label()
        .at((-1.6, -3.6))
        .label("Charger U1 (MCP73831, 2k: 500 mA) on BT1; wear it only unplugged.", halign="left")
    )


def _channel(drawing: schemdraw.Drawing) -> None:
    x, y = 0.0, -10.5
    drawing += (
        elements.Label()
        .at((x, y + 4.6))
        .label("One of four motor channels", fontsize=15, halign="left")
    )
    drawing += elements.Label().at((x - 1.2, y)).label("PD6, PD5,\nPB3, PD3")
    drawing += elements.Resistor().at((x, y)).right().label("R5  100 Ω")
    drawing += (gate := elements.Dot())
    drawing += elements.Resistor().at(gate.center).down().label("R6  100k", "bottom")
    drawing += elements.Ground()
    drawing += elements.Line().at(gate.center).right().length(0.8)
    drawing += (fet := elements.NFet(bulk=False).theta(0).reverse().anchor("gate"))
    drawing += elements.Label().at((x + 5.2, y)).label("Q1  AO3400A")
    drawing += elements.Line().at(fet.source).down().toy(gate.center[1] - 2.4)
    drawing += elements.Ground()
    drawing += elements.Line().at(fet.drain).up().length(0.4)
    drawing += (low := elements.Dot())
    drawing += elements.Motor().at(low.center).up().label("M1", "top")
    drawing += (high := elements.Dot().label("VM", "top"))
    drawing += elements.Line().at(low.center).right().length(2.0)
    drawing += (a := elements.Dot())
    drawing += elements.Schottky().at(a.center).up().toy(high.center).label("D1\n1N5819", "bottom")
    drawing += (b := elements.Dot())
    drawing += elements.Line().at(high.center).right().tox(b.center)
    drawing += elements.Line().at(a.center).right().length(2.2)
    drawing += elements.Capacitor().up().toy(high.center).label("C4\n100 nF", "bottom")
    drawing += elements.Line().left().tox(b.center)


def _processor(drawing: schemdraw.Drawing) -> None:
    pins = [
        PIN(name="PD6", side="right"),
        PIN(name="PD5", side="right"),
        PIN(name="PB3", side="right"),
        PIN(name="PD3", side="right"),
        PIN(name="ADC0", side="left"),
        PIN(name="ADC1", side="left"),
        PIN(name="ADC2", side="left"),
        PIN(name="RXD", side="bot"),
        PIN(name="TXD", side="bot"),
        PIN(name="GND", side="bot"),
        PIN(name="VCC", side="top"),
    ]
    drawing += (
        elements.Label()
        .at((12.0, -3.8))
        .label("Processor, radio, skin", fontsize=15, halign="left")
    )
    board = elements.Ic(pins=pins, size=(5.4, 5.0), edgepadH=0.8).theta(0).at((17.0, -11.6))
    board.label("ATmega328P\n8 MHz, 3.3 V", "center")
    drawing += board
    for name, text in (("PD3", "M4"), ("PB3", "M3"), ("PD5", "M2"), ("PD6", "M1")):
        drawing += elements.Line().at(getattr(board, name)).right().length(0.6).label(text, "right")
    for name, text in (("ADC0", "BAT / 4"), ("ADC1", "VM / 4")):
        drawing += elements.Line().at(getattr(board, name)).left().length(0.4).label(text, "left")
    power = "3.3 V; 100 nF, 10 µF"
    drawing += elements.Line().at(board.VCC).up().length(0.5).label(power, "right")
    drawing += elements.Line().at(board.ADC2).left().length(4.6)
    drawing += (skin := elements.Dot())
    drawing += elements.Resistor().at(skin.center).up().length(1.6).label("R7  10k", "bottom")
    drawing += elements.Vdd().label("3.3 V")
    drawing += (
        elements.Thermistor()
        .at(skin.center)
        .down()
        .label("TH1 10k, B 3380\non the skin side", "bottom")
    )
    drawing += elements.Ground()
    drawing += elements.Ground().at(board.GND)
    radio = (
        elements.Ic(pins=[PIN(name="TX", side="top"), PIN(name="RX", side="top")], size=(3.4, 1.5))
        .theta(0)
        .at((18.2, -16.2))
    )
    drawing += radio.label("HC-05 or HM-10", "bottom")
    drawing += elements.Wire("|-").at(board.RXD).to(radio.TX)
    drawing += elements.Wire("|-").at(board.TXD).to(radio.RX)


def main() -> None:
    """Write the picture."""
    TARGET.write_bytes(draw().get_imagedata("svg"))


if __name__ == "__main__":
    main()
