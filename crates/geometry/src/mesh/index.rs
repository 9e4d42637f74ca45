//! Index types: a vertex, a face, a half-edge and a loop cannot be mistaken for each other. Each is a `u32` at run
//! time.
//!
//! They number the elements of one mesh with its [`Topology`](super::topology::Topology). Plain numbers remain where
//! only one kind occurs, and in a [`Region`](super::region::Region), whose own mesh has a numbering of its own.

use std::fmt;

macro_rules! index_type {
    ($(#[$attribute:meta])* $name:ident) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// The number, to index a slice with.
            #[inline]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

index_type!(
    /// A vertex: an index into `TriMesh::positions`.
    VertexId
);
index_type!(
    /// A face: an index into `TriMesh::faces`.
    FaceId
);
index_type!(
    /// A half-edge: number `3 * face + corner` runs from that corner's vertex to the next corner's, with the face on
    /// its left.
    HalfEdgeId
);
index_type!(
    /// A boundary loop: an index into what [`boundary_loops`](super::loops::boundary_loops) returned.
    LoopId
);

impl FaceId {
    /// The face's half-edges; the first starts at its first corner.
    #[inline]
    pub fn half_edges(self) -> [HalfEdgeId; 3] {
        [0, 1, 2].map(|corner| HalfEdgeId(3 * self.0 + corner))
    }
}

impl HalfEdgeId {
    /// The face on its left.
    #[inline]
    pub fn face(self) -> FaceId {
        FaceId(self.0 / 3)
    }

    /// The corner (0..3) of its face that it starts from.
    #[inline]
    pub fn corner(self) -> usize {
        self.0 as usize % 3
    }

    /// The half-edge that follows it round its face.
    #[inline]
    pub fn next(self) -> HalfEdgeId {
        HalfEdgeId(if self.0 % 3 == 2 {
            self.0 - 2
        } else {
            self.0 + 1
        })
    }

    /// The half-edge that precedes it round its face.
    #[inline]
    pub fn previous(self) -> HalfEdgeId {
        HalfEdgeId(if self.0.is_multiple_of(3) {
            self.0 + 2
        } else {
            self.0 - 1
        })
    }
}
