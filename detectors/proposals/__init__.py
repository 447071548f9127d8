"""Class-agnostic proposals from depth: what stands out from large planes (Georgakis et al., III-A)."""
