//! Per frame: rates, masked blend, skinning, normals. Neither allocates nor fails.
