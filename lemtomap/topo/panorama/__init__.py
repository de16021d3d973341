"""What stands round a point, bearing by bearing: how alike two places are, and what changed in one."""
