"""Make the default cast from the CC0 MakeHuman base mesh; run by `stimuli.characters.generate`."""
