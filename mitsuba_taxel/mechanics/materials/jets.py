"""Numbers with their first and second derivatives with respect to two variables (second-order forward differentiation).

A derivative that is identically zero is ``None`` and costs nothing: the second derivatives of ``c * x`` are not
computed, and the first is the number c rather than an array (A. Griewank and A. Walther, Evaluating Derivatives, 2nd
ed., SIAM 2008, chapter 13).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Jet:
    """A function's value at (x, y), its derivatives d1 = d/dx, d2 = d/dy and second derivatives d11, d12, d22.

    Each of these is a number or an array; all broadcast together. Jets, numbers and arrays can be combined by ``+ - *
    /`` and ``**``; ``np.log``, ``np.exp``, ``np.sqrt`` and ``np.square`` apply to jets.
    """

    value: Any
    d1: Any = None
    d2: Any = None
    d11: Any = None
    d12: Any = None
    d22: Any = None

    def __add__(self, other: Any) -> Jet:
        a, b = self, _jet(other)
        return Jet(
            a.value + b.value,
            _sum(a.d1, b.d1),
            _sum(a.d2, b.d2),
            _sum(a.d11, b.d11),
            _sum(a.d12, b.d12),
            _sum(a.d22, b.d22),
        )

    def __mul__(self, other: Any) -> Jet:
        a, b = self, _jet(other)
        return Jet(
            a.value * b.value,
            _sum(_product(a.d1, b.value), _product(a.value, b.d1)),
            _sum(_product(a.d2, b.value), _product(a.value, b.d2)),
            _sum(_product(a.d11, b.value), _product(2.0, a.d1, b.d1), _product(a.value, b.d11)),
            _sum(_product(a.d12, b.value), _product(a.d1, b.d2), _product(a.d2, b.d1), _product(a.value, b.d12)),
            _sum(_product(a.d22, b.value), _product(2.0, a.d2, b.d2), _product(a.value, b.d22)),
        )

    def __pow__(self, exponent: Any) -> Jet:
        if isinstance(exponent, Jet):
            return np.exp(exponent * np.log(self))
        # 0 * x^-1 and 0 * x^-2 would fail at x = 0.
        first = exponent * self.value ** (exponent - 1) if exponent != 0 else None
        second = exponent * (exponent - 1) * self.value ** (exponent - 2) if exponent not in (0, 1) else None
        return self._through(self.value**exponent, first, second)

    def __neg__(self) -> Jet:
        derivatives = (self.d1, self.d2, self.d11, self.d12, self.d22)
        return Jet(-self.value, *(None if derivative is None else -derivative for derivative in derivatives))

    def __sub__(self, other: Any) -> Jet:
        return self + -_jet(other)

    def __truediv__(self, other: Any) -> Jet:
        return self * _jet(other) ** -1.0

    def __radd__(self, other: Any) -> Jet:
        return self + other

    def __rmul__(self, other: Any) -> Jet:
        return self * other

    def __rsub__(self, other: Any) -> Jet:
        return _jet(other) - self

    def __rtruediv__(self, other: Any) -> Jet:
        return _jet(other) / self

    def __rpow__(self, base: Any) -> Jet:
        return _jet(base) ** self

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options or ufunc not in _UFUNCS:
            return NotImplemented
        # The first operand becomes a jet: an array would pass the operation back to its ufunc.
        return _UFUNCS[ufunc](_jet(inputs[0]), *inputs[1:])

    def _through(self, value: Any, first: Any, second: Any) -> Jet:
        """Apply a function f to this jet (chain rule), given the value f, and the derivatives f' and f'', at
        ``self.value``."""
        return Jet(
            value,
            _product(first, self.d1),
            _product(first, self.d2),
            _sum(_product(first, self.d11), _product(second, self.d1, self.d1)),
            _sum(_product(first, self.d12), _product(second, self.d1, self.d2)),
            _sum(_product(first, self.d22), _product(second, self.d2, self.d2)),
        )


def _exp(jet: Jet) -> Jet:
    value = np.exp(jet.value)
    return jet._through(value, value, value)


def _log(jet: Jet) -> Jet:
    slope = 1.0 / jet.value
    return jet._through(np.log(jet.value), slope, -slope * slope)


_UFUNCS: dict[np.ufunc, Callable[..., Jet]] = {
    np.add: Jet.__add__,
    np.subtract: Jet.__sub__,
    np.multiply: Jet.__mul__,
    np.true_divide: Jet.__truediv__,
    np.power: Jet.__pow__,
    np.negative: Jet.__neg__,
    np.exp: _exp,
    np.log: _log,
    np.sqrt: lambda jet: jet**0.5,
    np.square: lambda jet: jet * jet,
}


def _jet(number: Any) -> Jet:
    return number if isinstance(number, Jet) else Jet(number)


def _sum(*terms: Any) -> Any:
    present = [term for term in terms if term is not None]
    return sum(present[1:], start=present[0]) if present else None


def _product(*factors: Any) -> Any:
    for factor in factors:
        if factor is None:
            return None
    product = factors[0]
    for factor in factors[1:]:
        product = product * factor
    return product
