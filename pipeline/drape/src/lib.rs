//! Cloth on a body: a sheet of particles comes to rest on a body under its weight, by the model of Hanami and Tokoi (`relax`, the P2 of
//! this project) or by the solver for production (`drape`), whose rest is certified (`certificate`). Knows no file formats, no garments and no packs, so that an interactive app may link it alone.
//!
//! Metres, newtons, kilograms, radians; right-handed, Y up, +Z front. Same inputs give the same bytes on any number of threads.
//!
//! ```
//! use kitsuke_drape::analytic_form;
//! use kitsuke_drape::depth_maps::DepthMaps;
//! use kitsuke_drape::fabric::Fabric;
//! use kitsuke_drape::relax::{Settings, State, to_rest};
//! use kitsuke_drape::sheet::{Grid, Sheet};
//! use glam::DVec3;
//!
//! let (positions_m, triangles) = analytic_form::sphere(DVec3::ZERO, 0.2, 32);
//! let body = DepthMaps::new(&positions_m, &triangles, 0.005)?;
//! let corner_m = DVec3::new(-0.25, 0.21, 0.25);
//! let grid = Grid { rows: 21, columns: 21, spacing_m: 0.025, corner_m, weft: DVec3::X, warp: DVec3::NEG_Z };
//! let sheet = Sheet::from_grid(&grid)?;
//! let (fabric, settings) = (Fabric::default(), Settings::default());
//! let mut state = State::new(&sheet, &fabric)?;
//! to_rest(&sheet, &fabric, Some(&body), &settings, 0.05, 2000, &mut state);
//! assert!(state.positions_m[0].y < 0.15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod analytic_form;
pub mod body;
mod cells;
pub mod certificate;
mod cloth_contact;
mod contacts;
pub mod cut;
pub mod depth_maps;
pub mod drape;
pub mod fabric;
pub mod forces;
pub mod form;
pub mod gestures;
pub mod hands;
pub mod intersections;
pub mod links;
pub mod mapping;
pub mod near_pairs;
pub mod outline;
mod parallel;
pub mod parting;
mod patches;
pub mod pattern;
pub mod relax;
pub mod repair;
pub mod rest;
pub mod room;
pub mod scissors;
pub mod sew;
pub mod sheet;
pub mod skirt;
pub mod skirt_by_forces;
pub mod slices;
pub mod slit;
pub mod springs;
pub mod tethers;
pub mod triangle_tree;
pub mod woven;
