"""Batched decompositions of LAPACK in a compiled program that nothing puts in an order, by the text of the program.

Each of them holds a thread of XLA's and waits until others have done its parts (jaxlib 0.10): as many side by side as
there are threads wait for ever, see `gmwm_jax._internal.xla_threads`.
"""

import re

_COMPUTATION = re.compile(r"^(?:ENTRY )?%?([\w.-]+) .*\{\s*$")
_INSTRUCTION = re.compile(r"^\s+(?:ROOT )?%?([\w.-]+) = (.*)$")
_CALLED = re.compile(r"(?:calls|body|condition|to_apply)=%?([\w.-]+)|branch_computations=\{([^}]*)\}")
_SHAPE = re.compile(r"\bf\d\d\[([\d,]+)\]")


def side_by_side(text):
    """Pairs of instructions of a program in HLO, none of which needs the other, with such decompositions in both."""
    computations = _computations(text)
    found = []
    for instructions in computations.values():
        position = {name: i for i, (name, _) in enumerate(instructions)}
        needs = []
        for _, body in instructions:
            own = {position[n] for n in re.findall(r"%([\w.-]+)", body) if n in position}
            needs.append(own.union(*(needs[i] for i in own if i < len(needs))))
        heavy = [i for i, (_, body) in enumerate(instructions) if _is_batch(body, computations)]
        found += [(instructions[i][0], instructions[k][0]) for k in heavy for i in heavy if i < k and i not in needs[k]]
    return found


def _computations(text):
    """Name -> names and texts of the instructions, in their order."""
    found, current = {}, None
    for line in text.splitlines():
        if line.startswith("}"):
            current = None
        elif head := _COMPUTATION.match(line):
            current = found.setdefault(head[1], [])
        elif current is not None and (instruction := _INSTRUCTION.match(line)):
            current.append((instruction[1], instruction[2].split(", metadata=")[0]))
    return found


def _is_batch(body, computations):
    """Whether it decomposes more than one matrix, or calls what does."""
    if 'custom_call_target="lapack' in body:
        batch = _SHAPE.search(body)[1].split(",")[:-2]
        return any(int(n) > 1 for n in batch)
    called = [name.strip().lstrip("%") for pair in _CALLED.findall(body) for name in ",".join(pair).split(",")]
    return any(_is_batch(inner, computations) for name in called for _, inner in computations.get(name, []))
