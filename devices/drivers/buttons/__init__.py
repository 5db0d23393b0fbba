"""What participants press: keyboards, button boxes, gamepads."""
