"""Files with more than 300 lines of code, for review: a long file is no fault, but a reason to look at it."""

import ast
import io
import sys
import tokenize
from pathlib import Path

LIMIT = 300
LAYOUT = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


def num_lines(source):
    """Lines that hold code: no blank ones, no comments, no docstrings."""
    code = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in LAYOUT:
            code.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        # a string that stands alone documents a module, a class, a function or the name above it
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            code.difference_update(range(node.lineno, node.end_lineno + 1))
    return len(code)


def main(folders):
    """Print them, the longest first."""
    paths = [path for folder in folders for path in Path(folder).rglob("*.py")]
    counted = sorted(((num_lines(path.read_text()), str(path)) for path in paths), reverse=True)
    for count, path in counted:
        if count > LIMIT:
            print(f"{count:5d} lines of code in {path}")


if __name__ == "__main__":
    main(sys.argv[1:])
