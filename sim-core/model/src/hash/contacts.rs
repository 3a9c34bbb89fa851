//! Shapes, pairs of them, and the tables of both.

use sim_physics::constants::clip::Cut;
use sim_physics::constants::contact::{
    Class, Column, Cone, Contacts, FrictionCombine, Handles, Kind, Memory, Pair, Run, Solid,
};
use sim_physics::constants::height_field::FieldTables;
use sim_physics::constants::hull::HullTables;
use sim_physics::constants::hull::reference::ReferenceSearch;
use sim_physics::constants::pair_groups::Group;
use sim_physics::lane::{Fixed, Table, Tables};

use std::sync::Arc;

use super::text::{Text, View, When, view, words};

view! {
    Contacts<f64> as "Contacts":
        Always {
            "cone": cone,
            "impratio": impratio,
            "solids": solids,
            "groups": groups,
            "classes": classes,
            "pairs": pairs,
            "contacts_max": contacts_max,
            "rows_max": rows_max,
            "may_overflow": may_overflow,
            "tables": tables,
            "handles": handles,
            "hulls": hulls,
        }
        Later { "fields": fields }
        Always { "memory": memory }
        Later { "turning": turning }
        Later { "skew": skew }
        Later { "surface_velocities": surface_velocities }
        Later { "adhesion": adhesion }
        Later { "combine": combine, "keeps_max": keeps_max }
        Later { "mujoco_capsule_boxes": two_point_capsule_boxes }
        Never { "ordered_corners": ordered_corners }
        Never { "reference": reference }
        Never { "room_grows": room_grows }
        => are_stiff, impedances, bodies, has_rules, varying, mixing, named_pairs, rolled;
    Handles as "Handles":
        Always {
            "pair_numbers": pair_numbers,
            "pair_indices": pair_indices,
            "class_rows": class_rows,
        }
        Never { "pair_blocks": pair_blocks };
    HullTables as "HullTables":
        Always {
            "spans": spans,
            "sizes": sizes,
            "vertices": vertices,
            "faces": faces,
            "corners": corners,
            "edges": edges,
        }
        Later { "cluster_spans": cluster_spans, "cluster_rows": cluster_rows, "clusters": clusters }
        Later {
            "ranks": ranks,
            "fan_spans": fan_spans,
            "fan_sizes": fan_sizes,
            "fans": fans,
            "origins": origins,
        };
    FieldTables as "FieldTables":
        Always {
            "heights": heights,
            "ceilings": ceilings,
            "tops": tops,
            "sizes": sizes,
            "cells": cells,
            "cells_max": cells_max,
        };
    Memory as "Memory":
        Always {
            "poses": poses,
            "origins": origins,
            "counts": counts,
            "rows": rows,
            "cut": cut,
        }
        Later {
            "field_candidates": field_candidates,
            "field_cells": field_cells,
            "field_prisms": field_prisms,
        }
        Always { "mu": mu, "len": len };
    Cut as "Cut":
        Always { "corners": corners, "candidates": candidates, "edges": edges };
    Solid<f64> as "Solid":
        Always {
            "kind": kind,
            "shape": shape,
            "body": body,
            "axes": axes,
            "is_upright": is_upright,
            "center": center,
        }
        => link, friction, softness;
    Group as "Group":
        Always { "kinds": kinds, "first": first, "end": end };
    Pair as "Pair":
        Always { "shapes": shapes, "links": links, "class": class };
    Class<f64> as "Class":
        Always {
            "trees": trees,
            "columns": columns,
            "runs": runs,
            "entries": entries,
            "couples": couples,
            "parts": parts,
            "shared": shared,
            "first": first,
            "capacity": capacity,
        }
        Later { "turns": turns }
        => update_path, mixes;
    Column as "Column":
        Always { "dof": dof, "is_first": is_first, "lever": lever }
        => tree;
    Run as "Run":
        Always { "column": column, "place": place, "len": len };
    Tables<f64> as "Tables":
        Always { "numbers": numbers, "indices": indices };
    Fixed as "Fixed":
        Always { "base": base, "stride": stride, "rows": rows };
}

words! {
    Cone: Elliptic "Elliptic", Pyramidal "Pyramidal";
    FrictionCombine: Max "Max", Mean "Mean", Min "Min", Product "Product";
    Kind: Plane "Plane", Field "Field", Sphere "Sphere", Capsule "Capsule", Box "Box", Cylinder "Cylinder",
        Ellipsoid "Ellipsoid", Hull "Hull";
}

/// How contacts are found in `f64`: no part of the text, since recordings in `f32` do not depend on it.
impl View for Arc<ReferenceSearch> {
    fn write(&self, _: &mut Text) {}
}

impl View for Table {
    fn write(&self, text: &mut Text) {
        let Table { base, stride, rows } = self;
        let values: [(&str, &dyn View); 3] = [("base", base), ("stride", stride), ("rows", rows)];
        text.groups("Table", &[(When::Always, &values)]);
    }

    /// A table that nothing is kept in still has a stride.
    fn is_absent(&self) -> bool {
        (self.base, self.stride, self.rows) == (0, 1, 0)
    }
}
