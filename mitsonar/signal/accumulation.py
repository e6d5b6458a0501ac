"""Add echoes to the impulse responses of an array's elements on the device: the hot loop of the simulator.

    z[e, n] += a exp(-2πi (φ + f₀ δ_e)) k(n - m - μ - f_s δ_e)                       [per hit and element]

a -> ``amplitude``, φ -> ``phase`` [cycles], m + μ -> ``sample`` + ``fraction``: the echo at the array's centre, split
in float64 by `centre`. δ_e -> ``difference`` [s], the extra delay at element e, is small, so that float32 suffices:
with f₀ = 500 kHz at 100 m the phase is right to 0.02 degrees, whereas float32 delays would be wrong by 5. k is a kernel
of `impulses`.

Taps lie in packets of four complex numbers. A packet must start at a multiple of four, so each response is kept as four
planes, shifted against each other by one sample, which `ImpulseResponses.read` adds up.

A group of 16384 lanes owns up to eight rows of the sums and adds all hits to them. A work block of Dr.Jit's LLVM
backend is 16384 lanes if a launch has more than two blocks per thread; idle groups ensure this. No two threads
therefore add to the same row, and the order of additions, hence every bit of the result, depends on the hits alone.
Rows of few elements are kept in several copies, each for a share of the hits. On a GPU the sums are atomic, and their
last bits vary.
"""
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, cast

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, looped, reinterpreted, upload
from mitsonar.device.types import ArrayTypes, Bool, DrJitArray, Float, Float64, Int32, UInt32

from .impulses import Kernel, Nearest, Peterson, make_kernel, tap_weights, turned

OfPair: TypeAlias = Callable[[Sequence[Float], Sequence[Float]], Float]    # (hit fields, element fields) -> value
LANES = 1 << 14                    # lanes of a group: Dr.Jit's largest work block
GROUPS = 32                        # number of groups aimed at, for machines of many cores
COPIES_BYTES = 1 << 28             # most memory for copies of rows
LARGEST = 1 << 32                  # numbers in an array of Dr.Jit
ROWS = 8                           # rows of a group of MANY elements or more: each hit is read once for all rows
FEW_ROWS = 4                       # rows of a group of fewer elements
MANY = 32
ROUNDS = 16                        # least number of hits of a lane: fewer do not pay for its start
NEIGHBOURS = 16                    # lanes that read neighbouring hits: the width of a vector
PACKET = 8                         # fields of a hit that are read at once
NOWHERE = -(1 << 30)               # sample of a hit that adds nothing


def centre(delay: Float64, *, start: float, frequency: float, sampling_rate: float) -> tuple[Float, Int32, Float]:
    """Split delays into carrier phase and place in the record.

    Parameters
    ----------
    delay : Float64 (H,) [s]
        Delays of the echoes at the array's centre; NaN where there is no echo.
    start : float [s]
        Time of sample 0.
    frequency, sampling_rate : float [Hz]

    Returns
    -------
    phase : Float (H,) [cycles]
        Fractional part of f₀ t, in [0, 1).
    sample : Int32 (H,)
    fraction : Float (H,)
        Fraction of a sample, in [0, 1).
    """
    lib = arrays_of(delay)
    begin, carrier, rate = (dr.opaque(lib.Float64, value) for value in (start, frequency, sampling_rate))
    cycles = delay * carrier
    place = (delay - begin) * rate
    sensible = abs(place) < -NOWHERE                        # false for NaN
    place = dr.select(sensible, place, 0)
    whole = dr.floor(place)
    return (lib.Float(dr.select(sensible, cycles - dr.floor(cycles), 0)),
            dr.select(sensible, lib.Int32(whole), NOWHERE), lib.Float(place - whole))


class HitTable:
    """Hold the fields of hits side by side: a hit is read in packets, cheaper than by a gather for each field."""
    # fields: Float (H,) or (1,)

    def __init__(self, lib: ArrayTypes, fields: list[Float], count: int):
        self.lib, self.varying = lib, [dr.width(field) > 1 for field in fields]
        self.alike = [field for field, varies in zip(fields, self.varying) if not varies]
        kept, hit = [field for field, varies in zip(fields, self.varying) if varies], dr.arange(lib.UInt32, count)
        self.tables: list[tuple[Float, int]] = []
        while kept:
            part, kept = kept[:PACKET], kept[PACKET:]
            width = max(2, 1 << (len(part) - 1).bit_length())
            part += [lib.Float(0)] * (width - len(part))
            table = dr.empty(lib.Float, count * width)
            dr.scatter(table, lib.ArrayXf(part), hit, mode=dr.ReduceMode.Permute)
            self.tables.append((table, width))
        dr.make_opaque(self.alike)
        dr.eval([table for table, _ in self.tables])

    def at(self, hit: UInt32, active: Bool) -> list[Float]:
        """Return all fields of hits."""
        read = iter([field for table, width in self.tables for field in dr.gather(
            self.lib.ArrayXf, table, hit, active, shape=(width, dr.width(hit)))])
        alike = iter(self.alike)
        return [next(read) if varies else next(alike) for varies in self.varying]


class ImpulseResponses:
    """Sum echoes at every element on the device.

    Parameters
    ----------
    like : Dr.Jit array or type
        Array or type of the backend to use, for example `mi.Float`.
    elements, samples : int
        Rows and columns of the result.
    sampling_rate, frequency : float [Hz]
        Sampling rate of the record; frequency of the carrier.
    kernel : {"band_limited", "peterson", "nearest"} or Kernel
    taps : int, optional
        Length of the ``peterson`` kernel [samples], a multiple of 4.
    sheets : int
        Number of responses kept for each element; each hit is added to one of them.

    Raises
    ------
    ValueError
        If the kernel is not known, or the sums need more than 32-bit indices.

    Notes ----- The sums take 32 bytes a sample and element (8 for ``nearest``). Copies for fewer than 256 elements take
    at most 256 MiB more. A new number of hits, elements or samples compiles no new kernel.
    """

    def __init__(self, like: DrJitArray | type, *, elements: int, samples: int, sampling_rate: float, frequency: float,
                 kernel: str | Kernel = "band_limited", taps: int | None = None, sheets: int = 1):
        if elements < 1 or samples < 1:
            raise ValueError(f"impulse responses of {elements} elements and {samples} samples were asked for; both "
                             f"must be 1 or more")
        self.lib = lib = arrays_of(like)
        self.kernel = make_kernel(kernel, taps=taps) if isinstance(kernel, str) else kernel
        self.elements, self.samples, self.sheets = int(elements), int(samples), int(sheets)
        self.planes, self.packet = (1, 2) if isinstance(self.kernel, Nearest) else (4, 8)
        self.span = self.samples + 2 * self.kernel.margin  # samples kept
        self.plane = -(-self.span // self.planes)          # packets of a plane
        self.row = self.planes * self.plane
        self.on_cpu = dr.backend_v(lib.Float) == dr.JitBackend.LLVM
        one = self.row * self.elements * self.sheets
        if one * self.packet >= LARGEST:
            raise ValueError(f"responses of {elements} elements and {samples} samples take "
                             f"{4 * one * self.packet / 2**30:.0f} GiB, and {4 * LARGEST >> 30} is the limit; "
                             f"accumulate fewer elements at a time or a shorter record")
        self.copies = self._copies(self.elements) if self.on_cpu else 1
        self.copies = max(1, min(self.copies, COPIES_BYTES // (4 * self.packet * one)))
        self.frequency, self.sampling_rate = (dr.opaque(lib.Float, value) for value in (frequency, sampling_rate))
        self.numbers = {name: dr.opaque(lib.UInt32, value) for name, value in dict(
            row=self.row, plane=self.plane, span=self.span, elements=self.elements,
            sheet=self.row * self.elements, copy=one).items()}
        # what falls outside the record goes to packets of its own, one for each group and lane of a vector: additions
        # to one and the same packet would wait for one another
        self.spare = NEIGHBOURS * max(2 * GROUPS, self.elements)
        self.clear()

    def clear(self) -> None:
        """Set all sums to zero."""
        packets = self.spare + self.copies * self.sheets * self.elements * self.row
        self.sums = dr.zeros(self.lib.Float, packets * self.packet)

    def add(self, *, amplitude: tuple[Float, Float], phase: Float, sample: Int32, fraction: Float,
            hit_fields: Sequence[Float], element_fields: Sequence[Float | np.ndarray], difference: OfPair,
            gain: OfPair | None = None, rows: Sequence[int] | np.ndarray | None = None,
            sheet: UInt32 | None = None) -> None:
        """Add the echoes of hits at elements.

        Parameters
        ----------
        amplitude : (Float, Float) (H,) [-]
            Real and imaginary part.
        phase : Float (H,) [cycles]
            Phase at the array's centre.
        sample : Int32 (H,)
            Sample at the array's centre. Hits far outside the record, for example at -2**30, add nothing, whatever
            their other fields hold.
        fraction : Float (H,)
            Fraction of a sample.
        hit_fields : sequence of Float (H,) or (1,)
            Fields of hits that `difference` and `gain` need.
        element_fields : sequence of Float or NumPy arrays (E,)
            Fields of elements that `difference` and `gain` need.
        difference : callable
            ``difference(hit_fields, element_fields)`` returns δ [s], the delay at the element less that at the centre.
        gain : callable, optional
            ``gain(hit_fields, element_fields)`` returns a real factor, for example the element's directivity.
        rows : sequence of int (E,), optional
            Elements of the result that `element_fields` belong to, each once; by default all in order.
        sheet : UInt32 (H,), optional
            Number of the sheet that each hit is added to, below `sheets`; by default the first.

        Notes
        -----
        Both callables are traced into the kernel with lists of Float. A Python number in them that changes from call to
        call compiles a new kernel each time; `drjit.opaque` prevents this. Gradients are not supported. Hits in order
        of time are summed about 1.2 times faster than in random order.
        """
        lib = self.lib
        rows = np.arange(self.elements) if rows is None else np.ravel(rows)
        fields = [cast(Float, field) if dr.is_jit_v(field) else upload(lib.Float, np.asarray(field, np.float32))
                  for field in element_fields]
        self._check(rows, fields)
        hits = [dr.detach(lib.Float(field)) for field in (*amplitude, phase, fraction, *hit_fields)]
        sample, sheet = dr.detach(lib.Int32(sample)), lib.UInt32(0 if sheet is None else sheet)
        count = max(dr.width(field) for field in (*hits, sample, sheet))
        wrong = sorted({dr.width(field) for field in (*hits, sample, sheet)} - {1, count})
        if wrong:
            raise ValueError(f"fields of {count} hits have {wrong[0]} values; give each as many values as hits, or one")
        if not len(rows) or not count:
            return
        with dr.suspend_grad():
            bits = [sample, sheet] if self.sheets > 1 else [sample]
            table = HitTable(lib, [*hits, *(reinterpreted(lib.Float, part) for part in bits)], count)
            dr.make_opaque(fields)
            numbers = upload(lib.UInt32, rows.astype(np.uint32))
            self._launch(count, table, fields, numbers, difference, gain)

    def read(self, sheet: int = 0) -> np.ndarray:
        """Return a sheet's responses, complex64 (elements, samples), their spectrum corrected; the sums are kept."""
        folded = self._fold(sheet).numpy().view(np.complex64).reshape(self.elements, self.span)
        margin = self.kernel.margin
        return np.ascontiguousarray(self.kernel.finish(folded)[:, margin:margin + self.samples])

    # -- who adds where ------------------------------------------------------------------------------------------

    def _rows(self, elements: int) -> int:
        """Return the number of rows of a group."""
        if isinstance(self.kernel, Peterson) or elements < 3:
            return 1
        return ROWS if elements >= MANY else FEW_ROWS

    def _copies(self, elements: int) -> int:
        """Return the number of private copies of the rows that make about GROUPS groups."""
        return -(-GROUPS // -(-elements // self._rows(elements)))

    def _check(self, rows: np.ndarray, fields: list[Float]) -> None:
        if len(rows) and not (len(np.unique(rows)) == len(rows) and 0 <= rows.min() and rows.max() < self.elements):
            raise ValueError(f"rows are {rows.min()} to {rows.max()}, {len(np.unique(rows))} different of {len(rows)}; "
                             f"give each of the elements 0 to {self.elements - 1} at most once")
        for field in fields:
            if dr.width(field) != len(rows):
                raise ValueError(f"element fields have {dr.width(field)} values for {len(rows)} elements; give one "
                                 f"value an element")

    def _launch(self, count: int, table: HitTable, fields: list[Float], rows: UInt32, difference: OfPair,
                gain: OfPair | None) -> None:
        lib, elements = self.lib, dr.width(rows)
        U = lib.UInt32
        together = self._rows(elements)
        teams = -(-elements // together)
        copies = min(self.copies, self._copies(elements)) if self.on_cpu else 1
        share = -(-count // copies)
        rounds = max(-(-share // LANES), ROUNDS)
        used = teams * copies
        groups = max(used, 2 * dr.thread_count() + 1) if self.on_cpu else used
        number = {name: dr.opaque(U, value) for name, value in dict(
            teams=teams, share=share, stretch=rounds * NEIGHBOURS, count=count, used=used, last=elements - 1,
            spare=self.spare, step=NEIGHBOURS).items()}

        lane = dr.arange(U, groups * LANES)
        group = lane // LANES
        lane -= group * LANES
        copy = group // number["teams"]
        first = (group - copy * number["teams"]) * together
        # a bundle of lanes takes a stretch of hits, lane by lane
        bundle = lane // NEIGHBOURS
        begin = copy * number["share"] + bundle * number["stretch"]
        end = dr.minimum(dr.minimum(begin + number["stretch"], (copy + 1) * number["share"]), number["count"])
        end = dr.select(group < number["used"], end, 0)
        neighbour = lane - bundle * NEIGHBOURS
        begin += neighbour
        outside = group * NEIGHBOURS + neighbour

        def packets(hit: UInt32, active: Bool, owned: list[tuple[UInt32, Bool, list[Float]]]) -> list[tuple[Any, ...]]:
            read = table.at(hit, active)
            on_sheet = reinterpreted(U, read.pop()) * self.numbers["sheet"] if self.sheets > 1 else U(0)
            place = reinterpreted(lib.Int32, read.pop())
            late = [(difference(read[4:], here), gain and gain(read[4:], here)) for _, _, here in owned]
            # Compiled in this order, delays of all rows first: their long chains of divisions overlap one another.
            dr.detail.new_scope(dr.backend_v(lib.Float))
            return [packet for (row, exists, _), delays in zip(owned, late)
                    for packet in self._packets(read[:4], place, *delays, row + on_sheet, outside,
                                                   active & exists)]

        def scatter(packets: list[tuple[Any, ...]]) -> None:
            mode = dr.ReduceMode.NoConflicts if self.on_cpu else dr.ReduceMode.Auto
            kind = lib.Array2f if self.packet == 2 else lib.ArrayXf
            for index, *values in packets:
                dr.scatter_add(self.sums, kind(*values) if self.packet == 2 else kind(values), index, mode=mode)

        def stream(hit: UInt32) -> tuple[UInt32]:
            """Add all hits of a lane; idle lanes do not run this."""
            owned = []
            for k in range(together):
                element = first + k
                exists = element <= number["last"]
                element = dr.minimum(element, number["last"])
                row = number["spare"] + copy * self.numbers["copy"] + dr.gather(U, rows, element) * self.numbers["row"]
                owned.append((row, exists,
                              [dr.gather(lib.Float, field, element) for field in fields]))
            # What was computed in one turn is added in the next, so that arithmetic and additions overlap.
            ready = packets(hit, lib.Bool(True), owned)

            def turn(hit: UInt32, ready: list[tuple[Any, ...]]) -> tuple[UInt32, list[tuple[Any, ...]]]:
                fresh = packets(hit, lib.Bool(True), owned)
                scatter(ready)
                return hit + number["step"], fresh

            hit, ready = looped((hit + number["step"], ready), lambda hit, ready: hit < end, turn, "hits")
            scatter(ready)
            return hit,

        looped((begin,), lambda hit: hit < end, stream, "echoes")
        dr.eval(self.sums)

    # -- one hit at one element ----------------------------------------------------------------------------------

    def _packets(self, hit, sample, delta, factor, row, outside, active):
        """Yield index and values of an echo's packets: `delta` is its extra delay, `factor` its gain at the element."""
        lib = self.lib
        real, imaginary, phase, fraction = hit
        cosine, sine = turned(lib, dr.fma(self.frequency, delta, phase))
        if factor is not None:
            cosine, sine = cosine * factor, sine * factor
        real, imaginary = dr.fma(real, cosine, imaginary * sine), dr.fma(imaginary, cosine, -(real * sine))
        place = dr.fma(self.sampling_rate, delta, fraction)
        half = self.kernel.taps // 2
        whole = dr.floor(place + 0.5) if self.planes == 1 else dr.floor(place)
        # the first tap, counted from the start of the margin; what lies before it wraps round to a large number
        tap = lib.UInt32(sample + lib.Int32(whole) + (self.kernel.margin + (0 if self.planes == 1 else 1 - half)))
        active &= (tap <= self.numbers["span"] - self.kernel.taps) & (abs(place) < LANES)
        packet = row + tap if self.planes == 1 else row + (tap & 3) * self.numbers["plane"] + (tap >> 2)
        packet = dr.select(active, packet, outside)
        weights = tap_weights(lib, self.kernel, place - whole)
        step = self.packet // 2
        for k in range(0, len(weights), step):
            values = [part * weight for weight in weights[k:k + step] for part in (real, imaginary)]
            yield dr.select(active, packet + k // step, outside) if k else packet, *values

    def _fold(self, sheet: int) -> Float:
        """Add up planes and copies of a sheet: interleaved complex rows, (elements x span)."""
        lib = self.lib
        U, n = lib.UInt32, self.numbers
        begin = self.spare + sheet * self.row * self.elements
        copies, begin = dr.opaque(U, self.copies), dr.opaque(U, begin * self.packet // 2)
        index = dr.arange(U, self.elements * self.span)
        element = index // n["span"]
        column = index - element * n["span"]
        values_in_row = n["row"] * (self.packet // 2)
        plane = n["plane"] * (self.packet // 2)
        begin += element * values_in_row

        def add(copy: UInt32, total: DrJitArray) -> tuple[UInt32, DrJitArray]:
            row = begin + copy * (n["copy"] * (self.packet // 2))
            for shift in range(self.planes):
                there = column >= shift
                total = total + dr.gather(lib.Array2f, self.sums, row + shift * plane + (column - shift), there)
            return copy + 1, total

        nothing = dr.zeros(lib.Array2f, dr.width(index))
        _, total = looped((U(0), nothing), lambda copy, total: copy < copies, add, "fold")
        return cast(Float, dr.ravel(total))
