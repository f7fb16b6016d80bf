"""What happens to bytes on a wire: cut into pieces, lost, changed, with noise in between."""

from hypothesis import strategies as st


def pieces(data, cuts):
    """Return the bytes in pieces, cut at the given places (taken modulo the length)."""
    places = sorted({cut % (len(data) + 1) for cut in cuts})
    ends = [*places, len(data)]
    return [data[begin:end] for begin, end in zip([0, *places], ends, strict=True)]


def feed_all(parser, parts, stamp=1):
    """Return all records and refusals of the pieces, which arrive 1 ms apart."""
    records, refusals = [], []
    for index, part in enumerate(parts):
        parsed = parser.feed(part, stamp + index * 1_000_000)
        records += parsed.records
        refusals += parsed.refusals
    return records, refusals


cuts = st.lists(st.integers(0, 10_000), max_size=12)
noise = st.binary(max_size=300)
