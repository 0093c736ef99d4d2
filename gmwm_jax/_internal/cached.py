"""Properties that are computed once, without a lock.

That of the standard library has, before Python 3.12, one lock for all objects of a class: a thread that computes the
intervals of one fit keeps those waiting that want the intervals of any other.
"""

import functools
from typing import Any, TypeVar, overload

T = TypeVar("T")


class cached_property(functools.cached_property[T]):
    """As `functools.cached_property`; two threads that ask one object at once may both compute, and get the same.

    Examples
    --------
    >>> from gmwm_jax._internal.cached import cached_property
    >>> class Square:
    ...     side = 3
    ...
    ...     @cached_property
    ...     def area(self):
    ...         return self.side**2
    >>> Square().area
    9
    """

    @overload
    def __get__(self, instance: None, owner: type[Any] | None = None) -> "cached_property[T]": ...
    @overload
    def __get__(self, instance: object, owner: type[Any] | None = None) -> T: ...
    def __get__(self, instance: Any, owner: type[Any] | None = None) -> Any:
        """Return what is known, or compute it."""
        if instance is None:
            return self
        known = instance.__dict__
        name = self.attrname
        assert name is not None  # it stands in a class
        return known[name] if name in known else known.setdefault(name, self.func(instance))
