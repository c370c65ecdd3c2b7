//! Nothing is lost: what is done is on the disk before it is shown, and comes back after a crash.
//!
//! 1. edits that are in no file yet - `journal`      2. steps to the mesh and edits of the relief - `kept`, `preparation`, `lasso`,
//!    `strokes`      3. the project file - `save`

pub mod journal;
pub mod kept;
pub mod lasso;
pub mod preparation;
pub mod save;
pub mod strokes;
