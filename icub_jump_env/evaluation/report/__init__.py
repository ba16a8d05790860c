"""How results leave the program: console, files, and the page of ``--report``."""
