"""The desk: a page on this computer that shows a lab's session and commands it.

A session listens for desks (`link`); a desk finds it, serves the page, and may be closed and opened
again at any time (`watch`, `server`). A session never waits for one.
"""
