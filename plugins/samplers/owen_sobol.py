"""Owen-scrambled Sobol' points over the dimensions of a light path."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsuba_taxel.backend.packets import in_packets
from mitsuba_taxel.base.caches import kept
from mitsuba_taxel.base.errors import InputError
from mitsuba_taxel.kernels.paths.sobol import DIMENSIONS, sobol_points
from mitsuba_taxel.specification.owen_sobol import MOST_POINTS
from mitsuba_taxel.specification.owen_sobol import OwenSobol as Parameters


class OwenSobol(mi.Sampler):
    r"""
    .. _sampler-owen_sobol:

    Owen-scrambled Sobol' sampler (:monosp:`owen_sobol`)
    ----------------------------------------------------

    Each sequence is the same Sobol' point set under an independent scrambling. Each sequence therefore gives an
    independent unbiased estimate, and the scatter of the estimates gives the standard error. The scrambling is Owen's
    nested uniform scrambling, computed by the hash of Laine and Karras (B. Burley, Practical Hash-based Owen
    Scrambling, JCGT 9 (4), 2020). For more than 24 dimensions the point set is reused in a new shuffled order.

    .. tabs::
        .. code-tab:: xml

            <sampler type="owen_sobol"> <integer name="sample_count" value="4096"/> </sampler>

        .. code-tab:: python

            'type': 'owen_sobol', 'sample_count': 4096
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.specification = Parameters.read(props)
        self.base_seed = self.specification.seed
        self.first = (0, 0)
        self.index, self.sequence_seed, self.dimension = (mi.UInt32(0) for _ in range(3))
        self.set_sample_count(self.specification.sample_count)

    def set_sample_count(self, spp: int) -> None:
        self.count = 1 << max(int(spp) - 1, 0).bit_length()
        super().set_sample_count(self.count)

    def place(self, first_point: int, first_sequence: int) -> None:
        """Set the first point and sequence of the next :meth:`seed`, to continue an earlier run point by point.

        Parameters
        ----------
        first_point : int
            Number of the first point of each sequence: 0, or a multiple of the sample count.
        first_sequence : int
            Number of the first sequence.
        """
        if first_point % self.count:
            raise InputError(f"first_point = {first_point} is not allowed: a multiple of {self.count} is needed.")
        if first_point + self.count > MOST_POINTS:
            raise InputError(
                f"owen_sobol: {first_point + self.count} points are not allowed: at most {MOST_POINTS} are possible."
            )
        self.first = (first_point, first_sequence)

    def seed(self, seed: mi.UInt32 | int, wavefront_size: int = 0xFFFFFFFF) -> None:
        super().seed(seed, wavefront_size)
        first_point, first_sequence = self.first
        size = 1 << (first_point + self.count - 1).bit_length()
        self.points = _table(size, mi.variant())
        self.stride = dr.opaque(mi.UInt32, size)
        self.first_bits = dr.opaque(mi.UInt32, max(1, min(8, size.bit_length() - 1)))
        lane = dr.arange(mi.UInt32, self.wavefront_size())
        self.index = dr.opaque(mi.UInt32, first_point) + (lane & dr.opaque(mi.UInt32, self.count - 1))
        bits = dr.opaque(mi.UInt32, self.count.bit_length() - 1)
        self.sequence = dr.opaque(mi.UInt32, first_sequence) + (lane >> bits)
        # An integer is made opaque, so that another seed needs no new kernel.
        seed = dr.opaque(mi.UInt32, seed & 0xFFFFFFFF) if isinstance(seed, int) else mi.UInt32(seed)
        key = seed + dr.opaque(mi.UInt32, self.base_seed)
        self.sequence_seed = mi.sample_tea_32(key, self.sequence)[0]
        self.dimension = mi.UInt32(0)

    def next_1d(self, active=True):
        group = self.dimension // DIMENSIONS
        column = self.dimension - group * DIMENSIONS
        index = dr.select(group == 0, self.index, self._shuffled(group))
        bits = dr.gather(mi.UInt32, self.points, column * self.stride + index)
        bits = dr.brev(_laine_karras(bits, _hash(self.sequence_seed ^ _hash(self.dimension + 0x9E3779B9))))
        self.dimension += 1
        return mi.Float(bits >> 8) * mi.Float(2.0**-24)

    def next_2d(self, active=True):
        return mi.Point2f(self.next_1d(active), self.next_1d(active))

    def advance(self) -> None:
        """Proceed to an independent scrambling of the same points."""
        self.sequence_seed = _hash(self.sequence_seed + 0x632BE5AB)
        self.dimension = mi.UInt32(0)

    def fork(self) -> OwenSobol:
        props = mi.Properties("owen_sobol")
        props["sample_count"] = self.count
        props["seed"] = self.base_seed
        return OwenSobol(props)

    def clone(self) -> OwenSobol:
        twin = self.fork()
        twin.__dict__.update(self.__dict__)
        twin.dimension = mi.UInt32(self.dimension)  # a copy, as it is incremented in place
        return twin

    def schedule_state(self) -> None:
        super().schedule_state()
        dr.schedule(self.index, self.sequence_seed, self.dimension)

    def to_string(self) -> str:
        return f"OwenSobol[sample_count = {self.count}, seed = {self.base_seed}]"

    def _shuffled(self, group: mi.UInt32) -> mi.UInt32:
        """The point index under a nested uniform permutation, which differs between groups of dimensions.

        The blocks of points 0 to 255, 256 to 511, 512 to 1023 and so on are permuted separately, so that a run can be
        continued without changing its points.
        """
        bits = dr.maximum(31 - dr.lzcnt(self.index | 1), self.first_bits)
        start = dr.select(self.index >> self.first_bits == 0, 0, mi.UInt32(1) << bits)
        unused = 32 - bits
        reverse = dr.brev(self.index - start) >> unused
        reverse = _laine_karras(reverse, _hash(self.sequence_seed + group)) & ((mi.UInt32(1) << bits) - 1)
        return (start + (dr.brev(reverse) >> unused)) & (self.stride - 1)


def _laine_karras(bits: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """Scramble bit-reversed digits so that each bit depends only on lower bits (constants: N. Vegdahl)."""
    bits ^= bits * 0x3D20ADEA
    bits += seed
    bits *= (seed >> 16) | 1
    bits ^= bits * 0x05526C56
    bits ^= bits * 0x53A22864
    return bits


def _hash(x: mi.UInt32) -> mi.UInt32:
    """A 32-bit hash with good mixing (constants: C. Wellons, lowbias32)."""
    x = mi.UInt32(x)
    x ^= x >> 16
    x *= 0x7FEB352D
    x ^= x >> 15
    x *= 0x846CA68B
    return x ^ (x >> 16)


@kept(4)
def _table(count: int, variant: str) -> mi.UInt32:
    """Coordinates of all Sobol' points, with reversed bits, one dimension after the other."""
    points = dr.brev(mi.UInt32(in_packets(sobol_points(count), np.uint32)))
    dr.eval(points)
    return points
