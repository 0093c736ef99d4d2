"""Messages of the library in the words of the page: its arguments are fields there."""

import re

FIELDS = {
    "rate": "Sampling rate",
    "units": "Unit",
    "time": "Column of time",
    "columns": "Columns",
    "channels": "Columns",
    "delimiter": "Delimiter",
    "header": "Line of names",
    "gaps": "Missing samples",
    "variable": "Columns",
    "efficiency": "Efficiency",
    "num_samples": "Samples",
}
_ARGUMENT = re.compile(r"""\b(\w+)=(\.\.\.|"[^"]*"|'[^']*'|\{[^}]*\}|\[[^]]*\]|[\d.]+)""")


def in_words_of_the_page(text: str) -> str:
    """Name fields in place of arguments.

    Examples
    --------
    >>> from gmwm_jax.app.web.words import in_words_of_the_page
    >>> in_words_of_the_page('The rate is missing: rate=... in Hz.')
    'The rate is missing: the field "Sampling rate" in Hz.'
    """

    def field(found: re.Match[str]) -> str:
        if found[1] not in FIELDS:
            return found[0]
        value = "" if found[2] == "..." else f" ({found[2].strip(chr(34) + chr(39))})"
        return f'the field "{FIELDS[found[1]]}"{value}'

    return _ARGUMENT.sub(field, text)
