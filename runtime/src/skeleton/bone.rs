//! The bones of a human body by their VRM 1.0 names. Knows no file format and no garment.

/// Declares [`Bone`] and its names from one list, so that the two cannot drift apart.
macro_rules! bones {
    ($($variant:ident $name:literal $parent:ident,)*) => {
        /// A bone of the VRM 1.0 humanoid (VRM 1.0, `humanoid.md`, "Humanoid Bone").
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Bone {
            $(#[doc = concat!("`", $name, "`")] $variant,)*
        }

        impl Bone {
            /// Every bone; `ALL[b as usize] == b`. Parents come before their children.
            pub const ALL: [Bone; Bone::COUNT] = [$(Bone::$variant,)*];
            /// How many bones VRM 1.0 names.
            pub const COUNT: usize = [$($name,)*].len();

            /// The VRM 1.0 name, for example `leftUpperArm`.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Bone::$variant => $name,)* }
            }

            /// The bone that VRM 1.0 puts above this one (where that optional bone is absent, its own parent takes over).
            #[must_use]
            pub const fn vrm_parent(self) -> Option<Bone> {
                match self { $(Bone::$variant => bones!(@parent $variant $parent),)* }
            }
        }
    };
    (@parent Hips Hips) => { None };
    (@parent $variant:ident $parent:ident) => { Some(Bone::$parent) };
}

bones! {
    Hips "hips" Hips,
    Spine "spine" Hips,
    Chest "chest" Spine,
    UpperChest "upperChest" Chest,
    Neck "neck" UpperChest,
    Head "head" Neck,
    LeftEye "leftEye" Head,
    RightEye "rightEye" Head,
    Jaw "jaw" Head,
    LeftUpperLeg "leftUpperLeg" Hips,
    LeftLowerLeg "leftLowerLeg" LeftUpperLeg,
    LeftFoot "leftFoot" LeftLowerLeg,
    LeftToes "leftToes" LeftFoot,
    RightUpperLeg "rightUpperLeg" Hips,
    RightLowerLeg "rightLowerLeg" RightUpperLeg,
    RightFoot "rightFoot" RightLowerLeg,
    RightToes "rightToes" RightFoot,
    LeftShoulder "leftShoulder" UpperChest,
    LeftUpperArm "leftUpperArm" LeftShoulder,
    LeftLowerArm "leftLowerArm" LeftUpperArm,
    LeftHand "leftHand" LeftLowerArm,
    RightShoulder "rightShoulder" UpperChest,
    RightUpperArm "rightUpperArm" RightShoulder,
    RightLowerArm "rightLowerArm" RightUpperArm,
    RightHand "rightHand" RightLowerArm,
    LeftThumbMetacarpal "leftThumbMetacarpal" LeftHand,
    LeftThumbProximal "leftThumbProximal" LeftThumbMetacarpal,
    LeftThumbDistal "leftThumbDistal" LeftThumbProximal,
    LeftIndexProximal "leftIndexProximal" LeftHand,
    LeftIndexIntermediate "leftIndexIntermediate" LeftIndexProximal,
    LeftIndexDistal "leftIndexDistal" LeftIndexIntermediate,
    LeftMiddleProximal "leftMiddleProximal" LeftHand,
    LeftMiddleIntermediate "leftMiddleIntermediate" LeftMiddleProximal,
    LeftMiddleDistal "leftMiddleDistal" LeftMiddleIntermediate,
    LeftRingProximal "leftRingProximal" LeftHand,
    LeftRingIntermediate "leftRingIntermediate" LeftRingProximal,
    LeftRingDistal "leftRingDistal" LeftRingIntermediate,
    LeftLittleProximal "leftLittleProximal" LeftHand,
    LeftLittleIntermediate "leftLittleIntermediate" LeftLittleProximal,
    LeftLittleDistal "leftLittleDistal" LeftLittleIntermediate,
    RightThumbMetacarpal "rightThumbMetacarpal" RightHand,
    RightThumbProximal "rightThumbProximal" RightThumbMetacarpal,
    RightThumbDistal "rightThumbDistal" RightThumbProximal,
    RightIndexProximal "rightIndexProximal" RightHand,
    RightIndexIntermediate "rightIndexIntermediate" RightIndexProximal,
    RightIndexDistal "rightIndexDistal" RightIndexIntermediate,
    RightMiddleProximal "rightMiddleProximal" RightHand,
    RightMiddleIntermediate "rightMiddleIntermediate" RightMiddleProximal,
    RightMiddleDistal "rightMiddleDistal" RightMiddleIntermediate,
    RightRingProximal "rightRingProximal" RightHand,
    RightRingIntermediate "rightRingIntermediate" RightRingProximal,
    RightRingDistal "rightRingDistal" RightRingIntermediate,
    RightLittleProximal "rightLittleProximal" RightHand,
    RightLittleIntermediate "rightLittleIntermediate" RightLittleProximal,
    RightLittleDistal "rightLittleDistal" RightLittleIntermediate,
}

impl Bone {
    /// The bone of this VRM 1.0 name, exactly as VRM spells it.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Bone> {
        Bone::ALL.into_iter().find(|bone| bone.name() == name)
    }

    /// The bone of this number, as stored in packs.
    #[must_use]
    pub fn from_index(index: u8) -> Option<Bone> {
        Bone::ALL.get(usize::from(index)).copied()
    }

    /// The same bone of the other side; a bone in the middle is its own.
    #[must_use]
    pub fn mirrored(self) -> Bone {
        let other = |side: &str, other: &str| {
            let rest = self.name().strip_prefix(side)?;
            Bone::ALL.into_iter().find(|bone| bone.name().strip_prefix(other) == Some(rest))
        };
        other("left", "right").or_else(|| other("right", "left")).unwrap_or(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_names_and_parents_agree() {
        for (i, bone) in Bone::ALL.into_iter().enumerate() {
            assert_eq!(bone as usize, i);
            assert_eq!(Bone::from_name(bone.name()), Some(bone));
            assert_eq!(Bone::from_index(i as u8), Some(bone));
            assert_eq!(bone.mirrored().mirrored(), bone);
            assert!(bone.vrm_parent().is_none_or(|parent| parent < bone), "{} before its parent", bone.name());
        }
        assert_eq!(Bone::COUNT, 55, "VRM 1.0 names 55 bones");
        assert_eq!(Bone::from_name("LeftArm"), None);
        assert_eq!(Bone::LeftRingDistal.mirrored(), Bone::RightRingDistal);
        assert_eq!(Bone::Chest.mirrored(), Bone::Chest);
    }
}
