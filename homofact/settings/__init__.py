"""How settings are declared, checked and read: options of dataclasses, TOML tables."""
