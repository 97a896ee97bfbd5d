"""A feedforward that an axis learns by repeating its program: what no effect explains, by place."""
