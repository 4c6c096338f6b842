//! Passes of constant scallop height: curves `side = g(path)`, each made from the one before while the tool is on that.
//!
//! With I and II the fundamental forms and r the ball's radius, a ball leaves at a small distance d from its contact the height `(I - r II)(d, d)/(2 r)`. So
//! passes of constant scallop height are parallel curves in the metric `I - r II` (Kim 2007), and the next one is a front that has moved by one step-over. The front is known at
//! fixed stations of the path parameter, with a cubic spline between them, so it is never parametrised anew:
//!
//! ```text
//! a dx^2 + 2 b dx dy + c dy^2 = K     [a b; b c] = I - r II,  K = 8 r h (1 - h/2r)/(1 + h k), k the curvature away from the tool
//! ```
//!
//! Whatever limits the front lowers it, which is safe: the height between two passes grows with their distance. A part of a front beyond the last side boundary is not
//! machined; each pass ends exactly on that boundary, and the last pass runs along it.
//!
//! | file | holds |
//! |---|---|
//! | [`table`] | the stations, in the job store after the job's words |
//! | [`side`] | the side parameter as one integer over all spans |
//! | [`frame`] | the metric at a surface point |
//! | [`foot`] | the step of a front at a place |
//! | [`spline`] | the curve through the stations |
//! | [`limits`] | slope and turning of a front |
//! | [`crest`] | the height between two fronts, measured by the balls |
//! | [`advance`] | the next front, in portions |
//! | [`cost`] | cycles of the portions |
//! | [`line`](mod@line) | a pass on a front, and its pieces |
//! | [`part`] | the parts of a front before the boundary |
//! | [`clip`] | those within a region |
//! | [`sequence`] | the passes in order |

mod advance;
mod clip;
mod cost;
mod crest;
mod foot;
mod frame;
mod limits;
mod line;
mod part;
mod sequence;
mod side;
mod spline;
pub(crate) mod table;

pub(crate) use line::{FrontLine, FrontPiece, PiecePlace};
pub(crate) use sequence::{FrontSequence, NextRoute};
