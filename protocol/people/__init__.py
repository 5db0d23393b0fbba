"""Who takes part: identifiers, ledger, key file, withdrawal, exports, one's own body, and the
contract of a simulated participant. Who simulates one is not here but in `visavis.people`.
"""
