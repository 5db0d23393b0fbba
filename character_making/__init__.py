"""Make the default cast from the CC0 MakeHuman base mesh; `generate` writes its files."""
