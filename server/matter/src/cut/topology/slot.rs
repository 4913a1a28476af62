//! Which of four slots holds a number.

/// The first slot that holds `number`. All four are compared: the position cannot be predicted, and a
/// mispredicted branch costs more than four comparisons.
#[inline(always)]
pub(crate) fn slot_of(slots: &[u32; 4], number: u32) -> Option<usize> {
    let held = (0..4).fold(0, |held, k| held | u32::from(slots[k] == number) << k);
    (held != 0).then_some(held.trailing_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use super::slot_of;

    #[test]
    fn the_first_slot_counts() {
        let slots = [7, 3, 7, 9];
        assert_eq!([7, 3, 9, 1].map(|n| slot_of(&slots, n)), [Some(0), Some(1), Some(3), None]);
    }
}
