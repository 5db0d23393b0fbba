"""Studies on a page in a browser: the page is a device on a wire.

Steps go out, numbered events come in, and each is acknowledged once it is on the disk.
"""
