"""An axis' frequency response, measured with an excitation of its own: plant, loop, margins."""
