"""Models that change while an axis holds, again and again, and processes killed meanwhile."""
