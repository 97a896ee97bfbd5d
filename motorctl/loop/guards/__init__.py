"""The safety rules, all of them here: what trips an axis, checked before a command leaves."""
