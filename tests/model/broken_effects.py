"""Effects as a beginner might write them, each with one thing wrong."""

from motorctl.model import Effect


class Bare(Effect):
    """Its module has no compiled column."""

    name = "bare"
    kind = "state"
    title = formula = compensated = identified = visible_in = "text"


class Wordless(Effect):
    """Does not tell its formula."""

    name = "wordless"
    kind = "state"
    title = compensated = identified = visible_in = "text"


class TwoWords(Effect):
    """Cannot be the name of a column."""

    name = "two words"
    kind = "state"
    title = formula = compensated = identified = visible_in = "text"


class Sideways(Effect):
    """Neither of the state nor of the input."""

    name = "sideways"
    kind = "sideways"
    title = formula = compensated = identified = visible_in = "text"
