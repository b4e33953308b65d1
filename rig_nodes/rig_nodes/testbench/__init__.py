"""The bench: configuration, the lockstep rig, its outputs, test sequences."""
