"""Parts of ``rig bench``: what each measures, the peers, and docs/performance.md."""
