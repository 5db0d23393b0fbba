"""The function tables of OpenVR's interfaces, from the package's own definitions, for C."""


def table_header() -> str:
    """Return C definitions of the function tables, from the package's own."""
    import openvr

    lines = []
    for name, table, version in (
        ("SYSTEM", openvr.IVRSystem_FnTable, openvr.IVRSystem_Version),
        ("COMPOSITOR", openvr.IVRCompositor_FnTable, openvr.IVRCompositor_Version),
    ):
        slots = [slot for slot, _ in table._fields_]
        listed = " ".join(f"X({name}, {slot})" for slot in slots)
        lines.append(f"#define {name}_SLOTS(X) {listed}")
        lines.append(f'#define {name}_VERSION "{version}"')
        numbered = ", ".join(f"SLOT_{name}_{slot}" for slot in slots)
        lines.append(f"enum {{ {numbered} }};")
    return "\n".join(lines) + "\n"
