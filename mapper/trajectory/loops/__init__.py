"""Links between keyframes that are not neighbours."""
