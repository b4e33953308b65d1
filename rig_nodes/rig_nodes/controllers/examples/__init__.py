"""Reference controllers: the Alfa46 law as Python class and as C library, to copy from and to test plugs."""
