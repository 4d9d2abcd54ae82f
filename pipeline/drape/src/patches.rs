//! A net of particles cut into patches that threads solve side by side: particles of a patch stand one after the other, and what holds
//! particles of one patch only is apart from what crosses. The cut depends on the net alone, never on the number of threads. Knows no
//! forces.
//!
//! What holds particles is in the order of colours: those of one colour have no particle in common. Passes along the cloth carry an error before them, and
//! cloth with fine cells and long steps explodes; passes by colour do not, need fewer parts for the same strain, and do not wait for each other in the processor.

use glam::DVec3;

/// Most particles of a patch.
const LARGEST: usize = 1024;

/// Particles in the order of their patches.
#[derive(Clone, Debug)]
pub struct Patches {
    /// For each place in the order, the particle.
    pub particle_at: Vec<u32>,
    /// For each particle its place.
    pub place_of: Vec<u32>,
    /// Where each patch begins, and the end of the last.
    pub starts: Vec<u32>,
}

/// What holds a few particles, sorted by the patches of these.
#[derive(Clone, Debug, Default)]
pub struct Sorted<T> {
    /// One list per patch: all particles in it, counted from its start.
    pub inner: Vec<Vec<T>>,
    /// Particles of several patches, by their places.
    pub crossing: Vec<T>,
}

impl Patches {
    /// Halves the particles at their median along the longest side until patches are small.
    #[must_use]
    pub fn of(positions_m: &[DVec3]) -> Patches {
        let mut particle_at: Vec<u32> = (0..positions_m.len() as u32).collect();
        let mut starts = vec![0];
        let mut waiting = vec![(0, positions_m.len())];
        while let Some((from, to)) = waiting.pop() {
            if to - from <= LARGEST {
                // Neighbours in the mesh's order are neighbours in memory.
                particle_at[from..to].sort_unstable();
                starts.push(to as u32);
                continue;
            }
            let (mut low_m, mut high_m) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for &particle in &particle_at[from..to] {
                low_m = low_m.min(positions_m[particle as usize]);
                high_m = high_m.max(positions_m[particle as usize]);
            }
            let axis = (high_m - low_m).max_position();
            let half = (to - from) / 2;
            let along = |particle: u32| positions_m[particle as usize][axis];
            particle_at[from..to]
                .select_nth_unstable_by(half, |&a, &b| along(a).total_cmp(&along(b)).then_with(|| a.cmp(&b)));
            waiting.push((from + half, to));
            waiting.push((from, from + half));
        }
        let mut place_of = vec![0; positions_m.len()];
        for (place, &particle) in particle_at.iter().enumerate() {
            place_of[particle as usize] = place as u32;
        }
        Patches { particle_at, place_of, starts }
    }

    /// Sorts what holds particles, given by their places, and then by colour; `shifted` counts them from the start of their patch.
    pub fn sorted<T: Clone, const N: usize>(
        &self,
        all: &[T],
        places: impl Fn(&T) -> [u32; N],
        shifted: impl Fn(&T, u32) -> T,
    ) -> Sorted<T> {
        let patch_of = |place: u32| self.starts.partition_point(|&start| start <= place) - 1;
        let mut sorted = Sorted { inner: vec![Vec::new(); self.starts.len() - 1], crossing: Vec::new() };
        for one in by_colour(all, self.particle_at.len(), &places) {
            let patches = places(one).map(patch_of);
            if patches.iter().all(|&patch| patch == patches[0]) {
                sorted.inner[patches[0]].push(shifted(one, self.starts[patches[0]]));
            } else {
                sorted.crossing.push(one.clone());
            }
        }
        sorted
    }

    /// The slices of an array in this order, one per patch.
    pub fn slices<'a, T>(&self, all: &'a mut [T]) -> Vec<&'a mut [T]> {
        let (mut slices, mut rest) = (Vec::new(), all);
        for ends in self.starts.windows(2) {
            let (slice, behind) = rest.split_at_mut((ends[1] - ends[0]) as usize);
            slices.push(slice);
            rest = behind;
        }
        slices
    }
}

/// Each takes the least colour that none of its particles has yet; beyond the last colour, particles may be in common.
fn by_colour<'a, T, const N: usize>(all: &'a [T], count: usize, places: &impl Fn(&T) -> [u32; N]) -> Vec<&'a T> {
    let mut taken = vec![0_u64; count];
    let mut coloured = Vec::with_capacity(all.len());
    for one in all {
        let at = places(one).map(|place| place as usize);
        let colour = at.iter().fold(0, |all, place| all | taken[*place]).trailing_ones().min(63);
        at.iter().for_each(|place| taken[*place] |= 1 << colour);
        coloured.push((colour, one));
    }
    coloured.sort_by_key(|(colour, _)| *colour);
    coloured.into_iter().map(|(_, one)| one).collect()
}
