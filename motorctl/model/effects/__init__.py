"""The effects that motorctl knows, one file each; whatever stands here is found by its name."""
