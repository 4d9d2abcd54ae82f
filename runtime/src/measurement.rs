//! Body measurements by their ISO 8559-1 terms, the wearer's side of a fit. Knows no file format, no unit but the metre and no
//! tailoring.

/// Declares [`Measurement`] with its names and plausible ranges from one list, so that they cannot drift apart.
macro_rules! measurements {
    ($($variant:ident $name:literal $ja:literal $low:literal..$high:literal,)*) => {
        /// A measurement of the body.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(u8)]
        pub enum Measurement {
            $(#[doc = concat!("`", $name, "`, ", $ja)] $variant,)*
        }

        impl Measurement {
            /// Every measurement; `ALL[m as usize] == m`.
            pub const ALL: [Measurement; Measurement::COUNT] = [$(Measurement::$variant,)*];
            /// How many measurements there are.
            pub const COUNT: usize = [$($name,)*].len();

            /// The name in tables, without unit, for example `bust_girth`.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Measurement::$variant => $name,)* }
            }

            /// The Japanese term.
            #[must_use]
            pub const fn ja(self) -> &'static str {
                match self { $(Measurement::$variant => $ja,)* }
            }

            /// Least and largest value that an adult or a tall child has, metres.
            #[must_use]
            pub const fn plausible_m(self) -> (f32, f32) {
                match self { $(Measurement::$variant => ($low, $high),)* }
            }
        }
    };
}

measurements! {
    BodyHeight "body_height" "身長" 1.0..2.3,
    BustGirth "bust_girth" "胸囲" 0.5..1.8,
    UnderbustGirth "underbust_girth" "アンダーバスト" 0.45..1.7,
    WaistGirth "waist_girth" "胴囲" 0.4..1.8,
    HipGirth "hip_girth" "腰囲" 0.5..1.9,
    NeckGirth "neck_girth" "首囲" 0.2..0.6,
    UpperArmGirth "upper_arm_girth" "上腕囲" 0.15..0.6,
    WristGirth "wrist_girth" "手首囲" 0.1..0.3,
    ThighGirth "thigh_girth" "大腿囲" 0.3..1.0,
    InsideLegLength "inside_leg_length" "股下" 0.4..1.15,
    ShoulderWidth "shoulder_width" "肩幅" 0.22..0.6,
    ArmLength "arm_length" "袖丈(腕)" 0.3..0.8,
    BackNeckToWaist "back_neck_to_waist" "背丈" 0.25..0.6,
    BackNeckToWrist "back_neck_to_wrist" "裄" 0.4..1.0,
}

/// What is known of one wearer's body, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurements([Option<f32>; Measurement::COUNT]);

impl Measurements {
    /// One measurement, metres; `None` where it is not known.
    #[must_use]
    pub fn get(&self, measurement: Measurement) -> Option<f32> {
        self.0[measurement as usize]
    }

    /// The same with one more known, metres.
    #[must_use]
    pub fn with(mut self, measurement: Measurement, value_m: f32) -> Measurements {
        self.0[measurement as usize] = Some(value_m);
        self
    }
}
