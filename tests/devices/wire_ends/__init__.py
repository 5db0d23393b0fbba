"""Other ends of real wires, for tests: radios, buses, servers and the firmware itself."""
