//! All suites, one binary.

mod blending;
mod bodies;
mod build;
mod covered;
mod fit;
mod fit_data;
mod frame;
mod garment;
mod hostile;
mod inputs;
mod invariants;
mod limits;
mod live;
mod look;
mod mistakes;
mod motion;
mod obj_text;
mod pack;
mod rigs;
mod skinning;
mod suggest;
mod tailoring;
mod texture;
mod transfer;
mod wearer;
mod weld;
