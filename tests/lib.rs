//! Nothing of its own: see `suites/`.
