"""The back end: association, tracks, ledger, smoother, beliefs and lifecycle."""
