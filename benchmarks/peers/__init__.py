"""The same problem in general tools, each written the way its documentation shows; see
`benchmarks.peer_table`; and what other programs do, for `benchmarks.published`."""
