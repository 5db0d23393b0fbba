"""Device contracts, registry, pump, drivers, wire-level simulators and the conformance suite.

A driver is codec + transport + class; only the transport differs between lab and simulation.
"""
