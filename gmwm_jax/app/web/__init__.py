"""The app in a browser: rooms of a page, and the pure functions that they show: figures, tables, units, scripts.

Functions of results know nothing of the page: `figures` and `tables` make what is seen, `library` and `formula` what is
looked up, `snippets`, `script` and `report` what is taken away. It needs the extra ``web``.
"""
