//! Space divided into cubes, and which of them each thing lies in, kept up to date as things move (P2, section 5: membership as
//! dynamic information). Knows no cloth.

use glam::DVec3;

/// Cells along each axis before they repeat, a power of two. What lies a whole period apart shares a cell, which costs a look and no more.
const PERIOD: u32 = 32;

/// Things by the cube in which their middle lies.
#[derive(Clone, Debug)]
pub struct Cells {
    cell_m: f64,
    members: Vec<Vec<u32>>,
    cell_of: Vec<u32>,
}

impl Cells {
    /// Cubes of the given width, metres, above 0, with a thing at each place.
    pub fn new(cell_m: f64, places_m: &[DVec3]) -> Cells {
        let mut members = vec![Vec::new(); (PERIOD * PERIOD * PERIOD) as usize];
        let cell_of: Vec<u32> = places_m.iter().map(|&place| number(column_row_layer(cell_m, place))).collect();
        for (thing, &cell) in cell_of.iter().enumerate() {
            members[cell as usize].push(thing as u32);
        }
        Cells { cell_m, members, cell_of }
    }

    /// The cell of a place.
    pub fn cell(&self, place_m: DVec3) -> u32 {
        number(column_row_layer(self.cell_m, place_m))
    }

    /// Moves the things whose cell has changed.
    pub fn update(&mut self, cell_of: &[u32]) {
        for (thing, (old, &new)) in self.cell_of.iter_mut().zip(cell_of).enumerate() {
            if *old != new {
                self.members[*old as usize].retain(|&member| member as usize != thing);
                self.members[new as usize].push(thing as u32);
                *old = new;
            }
        }
    }

    /// What lies in the cell of a place and the 26 around it; all within a cell's width of the place are among it. The order
    /// depends on how things came there.
    pub fn around(&self, place_m: DVec3) -> impl Iterator<Item = u32> + '_ {
        let middle = column_row_layer(self.cell_m, place_m);
        (0..27u32).flat_map(move |i| {
            let offset = [i % 3, i / 3 % 3, i / 9].map(|step| step.wrapping_sub(1));
            self.members[number(std::array::from_fn(|axis| middle[axis].wrapping_add(offset[axis]))) as usize]
                .iter()
                .copied()
        })
    }
}

fn column_row_layer(cell_m: f64, place_m: DVec3) -> [u32; 3] {
    // By way of i64, whose low bits go on counting below 0.
    [0, 1, 2].map(|axis| (place_m[axis] / cell_m).floor() as i64 as u32)
}

fn number([column, row, layer]: [u32; 3]) -> u32 {
    ((layer % PERIOD) * PERIOD + row % PERIOD) * PERIOD + column % PERIOD
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(step: u32) -> DVec3 {
        let part = |by: f64| (f64::from(step) * by).fract() * 2.0 - 1.0;
        DVec3::new(part(0.754_877), part(0.569_840), part(0.819_173)) * 1.5
    }

    #[test]
    fn all_that_is_near_is_found_before_and_after_moving() {
        let places: Vec<DVec3> = (0..500).map(place).collect();
        let mut cells = Cells::new(0.3, &places);
        let moved: Vec<DVec3> = (0..500).map(|i| place(7 * i + 3)).collect();
        for places in [places, moved] {
            let cell_of: Vec<u32> = places.iter().map(|&place| cells.cell(place)).collect();
            cells.update(&cell_of);
            let mut pairs = 0;
            for &from in &places {
                let found: Vec<u32> = cells.around(from).collect();
                for near in (0..500).filter(|&i| (places[i] - from).length() <= 0.3) {
                    assert_eq!(found.iter().filter(|&&member| member as usize == near).count(), 1);
                    pairs += 1;
                }
            }
            assert!(pairs > 600, "{pairs}");
            assert_eq!(cells.members.iter().map(Vec::len).sum::<usize>(), 500);
        }
    }
}
