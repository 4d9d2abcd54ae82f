//! P0: from a pose to blend rates. Knows no mesh.
