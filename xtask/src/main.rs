//! `cargo xtask <verb>`: one file per verb.

mod atlas;
mod audit;
mod bench;
mod build_catalog;
mod check;
mod ci;
mod clean;
mod compare_packs;
mod compare_registration;
mod covered;
mod drape_scene;
mod evaluate;
mod export;
mod fit;
mod form;
mod hands;
mod inspect;
mod leave_one_out;
mod masks;
mod new;
mod pattern_files;
mod places;
mod play;
mod pose_rows;
mod preview;
mod register;
mod registration_error;
mod replay;
mod scan_texture;
mod scans;
mod schema;
mod shots;
mod skinning;
mod suggest;
mod tailor;
mod texture;
mod view;
mod wasm;
mod wearers;
mod weld;

use clap::Parser;
use std::process::ExitCode;

/// Kimono packs: check, build, look, measure
#[derive(clap::Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version)]
enum Verb {
    Atlas(atlas::Args),
    Audit(audit::Args),
    Bench(bench::Args),
    BuildCatalog(build_catalog::Args),
    Check(check::Args),
    Ci(ci::Args),
    Clean(clean::Args),
    ComparePacks(compare_packs::Args),
    CompareRegistration(compare_registration::Args),
    Covered(covered::Args),
    DrapeScene(drape_scene::Args),
    Evaluate(evaluate::Args),
    Export(export::Args),
    Fit(fit::Args),
    Form(form::Args),
    Hands(hands::Args),
    Inspect(inspect::Args),
    LeaveOneOut(leave_one_out::Args),
    Masks(masks::Args),
    New(new::Args),
    Play(play::Args),
    PoseRows(pose_rows::Args),
    Preview(preview::Args),
    Register(register::Args),
    Replay(replay::Args),
    Schema(schema::Args),
    Skinning(skinning::Args),
    Suggest(suggest::Args),
    Tailor(tailor::Args),
    Texture(texture::Args),
    View(view::Args),
    Wasm(wasm::Args),
    Weld(weld::Args),
}

fn main() -> ExitCode {
    match Verb::parse() {
        Verb::Atlas(args) => atlas::run(args),
        Verb::Audit(args) => audit::run(args),
        Verb::Bench(args) => bench::run(args),
        Verb::BuildCatalog(args) => build_catalog::run(args),
        Verb::Check(args) => check::run(args),
        Verb::Ci(args) => ci::run(args),
        Verb::Clean(args) => clean::run(args),
        Verb::ComparePacks(args) => compare_packs::run(args),
        Verb::CompareRegistration(args) => compare_registration::run(args),
        Verb::Covered(args) => covered::run(args),
        Verb::DrapeScene(args) => drape_scene::run(args),
        Verb::Evaluate(args) => evaluate::run(args),
        Verb::Export(args) => export::run(args),
        Verb::Fit(args) => fit::run(args),
        Verb::Form(args) => form::run(args),
        Verb::Hands(args) => hands::run(args),
        Verb::Inspect(args) => inspect::run(args),
        Verb::LeaveOneOut(args) => leave_one_out::run(args),
        Verb::Masks(args) => masks::run(args),
        Verb::New(args) => new::run(args),
        Verb::Play(args) => play::run(args),
        Verb::PoseRows(args) => pose_rows::run(args),
        Verb::Preview(args) => preview::run(args),
        Verb::Register(args) => register::run(args),
        Verb::Replay(args) => replay::run(args),
        Verb::Schema(args) => schema::run(args),
        Verb::Skinning(args) => skinning::run(args),
        Verb::Suggest(args) => suggest::run(args),
        Verb::Tailor(args) => tailor::run(args),
        Verb::Texture(args) => texture::run(args),
        Verb::View(args) => view::run(args),
        Verb::Wasm(args) => wasm::run(args),
        Verb::Weld(args) => weld::run(args),
    }
}
