"""One module a protocol; each documents the paper section that it follows."""
