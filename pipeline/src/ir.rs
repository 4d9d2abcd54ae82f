//! The checked garment: metres, radians, every reference resolved. What `source` and `check` make and the stages
//! read; knows no file format.

use glam::{Affine3A, Quat, Vec2, Vec3};
use kitsuke::accessories::Texture;
use kitsuke::arrays::PoseLimit;
use kitsuke::fit::SizeBody;
use kitsuke::skeleton::{Bone, Pose, Skeleton};
use kitsuke::tailoring::RuleSet;

/// A kimono as the artist gave it, checked.
#[derive(Clone, Debug)]
pub struct Garment {
    /// Catalog name = folder name.
    pub id: String,
    /// The name people read.
    pub name: String,
    /// The base in its T-pose, in the file's own vertex order.
    pub base: Surface,
    /// The wearer on whom base and targets were made.
    pub body: Body,
    /// Her file's name, without its kind.
    pub body_name: String,
    /// A rigid band worn over it (obi), for pictures and to know where the skirt begins.
    pub obi: Option<Surface>,
    /// The base colour texture, as in the file.
    pub texture: Option<Texture>,
    /// Whether the texture's image travels in the pack.
    pub texture_in_pack: bool,
    /// The joints of the pose table.
    pub pose_bones: Vec<Bone>,
    /// The target shapes, in the order of the pose table.
    pub targets: Vec<TargetShape>,
    /// Drivers, in the manifest's order.
    pub drivers: Vec<Driver>,
    /// What the kimono allows its wearer, yet without bounds.
    pub pose_limits: Vec<PoseLimit>,
    /// How the regions are made.
    pub regions: Regions,
    /// Most correctives of each group of drivers.
    pub correctives: usize,
    /// Measured paths (P1), by name.
    pub paths: Vec<MeasuredPath>,
    /// The sizes in which it exists, if it can be fitted.
    pub sizes: Option<Sizes>,
    /// The rule sets by which it is fitted; the first is its own.
    pub rules: Vec<RuleSet>,
    /// How far the posed surface may lie from what the target files give, metres.
    pub budget_m: f32,
    /// How far any vertex may move per degree of one joint, metres; `None`: as it comes.
    pub speed_budget_m: Option<f32>,
    /// How far any target may lie from its prediction by the others, metres; `None`: as it comes.
    pub unseen_budget_m: Option<f32>,
    /// How deep the cloth may lie in the body in the audit's poses, metres; `None`: as it comes.
    pub inside_budget_m: Option<f32>,
}

impl Garment {
    /// Where the skirt begins: the obi's lower edge, or the hips without an obi; metres above the origin.
    #[must_use]
    pub fn skirt_top_m(&self) -> f32 {
        let skeleton = &self.body.skeleton;
        match &self.obi {
            Some(obi) => obi.positions_m.iter().fold(f32::MAX, |low, p| low.min(p.y)),
            None => skeleton.joints()[skeleton.index_of(Bone::Hips).unwrap_or(0)].rest_m.y,
        }
    }
}

/// A triangle mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Metres, in file order.
    pub positions_m: Vec<Vec3>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates in file order; empty when the file has none.
    pub uv: Vec<Vec2>,
    /// Texture-coordinate indices, one triple per triangle; empty when the file has none.
    pub uv_triangles: Vec<[u32; 3]>,
    /// Named pieces: runs of triangles, in order.
    pub parts: Vec<Part>,
}

/// A named run of triangles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Group name in the file.
    pub name: String,
    /// Number of triangles after those of the part before.
    pub triangle_count: u32,
}

/// A body with skeleton and skin weights, in the T-pose.
#[derive(Clone, Debug)]
pub struct Body {
    /// The skin's surface.
    pub surface: Surface,
    /// Joints and rest positions.
    pub skeleton: Skeleton,
    /// Per vertex up to four (joint index, weight), weights summing to 1.
    pub skin: Vec<[(u8, f32); 4]>,
}

impl Body {
    /// The surface in a pose by linear blend skinning, metres.
    #[must_use]
    pub fn posed_m(&self, pose: &Pose) -> Vec<Vec3> {
        let mut posed_from_rest = vec![Affine3A::IDENTITY; self.skeleton.frame_count()];
        self.skeleton.posed_from_rest(pose, &mut posed_from_rest);
        let posed = |(p, weights): (&Vec3, &[(u8, f32); 4])| {
            weights.iter().map(|&(joint, w)| posed_from_rest[usize::from(joint)].transform_point3(*p) * w).sum()
        };
        self.surface.positions_m.iter().zip(&self.skin).map(posed).collect()
    }
}

/// A wearer's own body as it comes.
#[derive(Clone, Debug)]
pub enum WearerBody {
    /// With joints and weights of its own.
    Skinned(Body),
    /// A surface alone: the base's body in another shape, vertex for vertex.
    Bare(Surface),
}

/// One target: a pose and the shape of the kimono in it.
#[derive(Clone, Debug)]
pub struct TargetShape {
    /// The pose table's name.
    pub name: String,
    /// Path as in the pose table, for reports.
    pub file: String,
    /// The layer to whose drivers it answers.
    pub layer: u8,
    /// Local rotations of `pose_bones`, the arms untwisted ([`kitsuke::skeleton::Pose::with_arms_untwisted`]).
    pub rotations: Vec<Quat>,
    /// Positions as simulated or scanned, metres, in the base's vertex order.
    pub positions_m: Vec<Vec3>,
}

/// A joint or group of joints that chooses among the samples.
#[derive(Clone, Debug)]
pub struct Driver {
    /// The manifest's name.
    pub name: String,
    /// Drivers of one group blend together (an arm); the driver's own name where the artist gives none.
    pub group: String,
    /// Joints compared.
    pub joints: Vec<Bone>,
    /// Similar means no farther than this.
    pub threshold_rad: f32,
    /// Groups that no pose turns together belong to layers of their own, which add.
    pub layer: u8,
}

/// Where the region masks come from.
#[derive(Clone, Debug)]
pub enum Regions {
    /// Grown from where the targets differ.
    Auto,
    /// Painted: per driver one weight in 0..=1 per base vertex, read from PNG through UV.
    Painted(Vec<Vec<f32>>),
}

/// A tailoring dimension as a path along edges of the base.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredPath {
    /// For example `sode_take_left`.
    pub name: String,
    /// Kanji.
    pub ja: String,
    /// Base vertices, each joined to the next by an edge.
    pub vertices: Vec<u32>,
    /// Added to the sum of the edge lengths, metres.
    pub offset_m: f32,
    /// The dimension of the rule sets that says how long it should be; `None`: it is not fitted.
    pub rule: Option<String>,
    /// How much an error counts in a fit, above 0.
    pub load: f32,
}

/// The same kimono tailored to several bodies, in the T-pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sizes {
    /// The bodies: first the base's, then each shape's.
    pub bodies: Vec<SizeBody>,
    /// The kimono on the bodies after the first.
    pub shapes: Vec<SizeShape>,
}

/// The kimono in one size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SizeShape {
    /// Path as in the size table, for reports.
    pub file: String,
    /// Metres, in the base's vertex order.
    pub positions_m: Vec<Vec3>,
    /// Texture coordinates in the base's order; empty when the base has none.
    pub uv: Vec<Vec2>,
}
