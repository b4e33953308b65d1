"""The verbs of the `rig` command, one module each; main.py finds and runs them."""
