"""The evaluator: a map against the truth, one module a protocol."""
