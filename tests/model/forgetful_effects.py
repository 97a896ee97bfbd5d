"""Effects that say that they remember, in modules that cannot."""

from numba import njit

from motorctl.model import Effect


class _Words(Effect):
    """What every effect has to say."""

    kind = "state"
    title = formula = compensated = identified = visible_in = "words"


class Forgetful(_Words):
    """Remembers in every form."""

    name = "forgetful"
    memory = 1


class SometimesForgetful(_Words):
    """Remembers in some forms."""

    name = "sometimes_forgetful"

    @property
    def memory_size(self):
        return 1


@njit
def column(j, x, v, a, vs, t, w, c):
    return w[0]
