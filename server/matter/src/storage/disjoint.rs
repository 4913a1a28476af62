//! Disjoint sets of numbered items (union–find). `root[a]` is another member of the set of `a`, or `a`
//! itself if it represents the set. The smallest member represents it.

/// The representative of the set of `a`; shortens the path to it.
pub fn find(root: &mut [u32], mut a: u32) -> u32 {
    while root[a as usize] != a {
        root[a as usize] = root[root[a as usize] as usize];
        a = root[a as usize];
    }
    a
}

/// Unites the sets of `a` and `b`. Returns their common representative.
pub fn join(root: &mut [u32], a: u32, b: u32) -> u32 {
    let (a, b) = (find(root, a), find(root, b));
    root[a.max(b) as usize] = a.min(b);
    a.min(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_sets_have_their_smallest_member_in_common() {
        let mut root: Vec<u32> = (0..6).collect();
        assert_eq!(join(&mut root, 5, 3), 3);
        assert_eq!(join(&mut root, 1, 5), 1);
        let found: Vec<u32> = (0..6).map(|a| find(&mut root, a)).collect();
        assert_eq!(found, [0, 1, 2, 1, 4, 1]);
    }
}
