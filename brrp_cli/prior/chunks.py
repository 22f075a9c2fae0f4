"""Chunks of a data set, before HDF5 unpacks them: it sets no bound to what a chunk unpacks to."""

from __future__ import annotations

import math
import zlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import h5py

# h5py cuts data sets into chunks of up to a megabyte.
MAX_CHUNK_BYTES = 2**24
MAX_CHUNKS = 20_000
_FLETCHER32_BYTES = 4


def check_chunks(data: h5py.Dataset, where: str) -> None:
    """ValueError or zlib.error unless each chunk that is stored unpacks to its size, by the filters
    that brrp writes with: shuffle, gzip, fletcher32, none of them left out."""
    from h5py import h5z

    layout = data.id.get_create_plist()
    filters = [layout.get_filter(i)[0] for i in range(layout.get_nfilters())]
    if not set(filters) <= {h5z.FILTER_SHUFFLE, h5z.FILTER_DEFLATE, h5z.FILTER_FLETCHER32}:
        raise ValueError(f"{where}: filters {filters}")
    size = math.prod(data.chunks) * data.dtype.itemsize
    grid = math.prod(-(-n // c) for n, c in zip(data.shape, data.chunks, strict=True))
    if size > MAX_CHUNK_BYTES or grid > MAX_CHUNKS:
        raise ValueError(f"{where}: {grid} chunks of {size} bytes")
    packed = h5z.FILTER_DEFLATE in filters
    for index in range(data.id.get_num_chunks()):
        chunk = data.id.get_chunk_info(index)
        if chunk.filter_mask:
            raise ValueError(f"{where}: a chunk without its checksum")
        if chunk.size > 2 * size + 1024:
            raise ValueError(f"{where}: a chunk of {chunk.size} bytes")
        if packed:
            _, stored = data.id.read_direct_chunk(chunk.chunk_offset)
            stream = zlib.decompressobj()
            unpacked = len(stream.decompress(stored[:-_FLETCHER32_BYTES], size + 1))
            if unpacked != size:
                raise ValueError(f"{where}: a chunk that does not unpack to {size} bytes")
