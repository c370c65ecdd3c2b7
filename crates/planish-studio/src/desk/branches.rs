//! Edits that were left for others: who takes edits back and goes another way can come back to the first one, until the project
//! is put away.

use super::Table;
use super::beside::{Branch, edit_of};
use super::project::{NO_PROJECT, Project, Refused};
use crate::protocol::{Why, state};
use crate::web::hub::Client;
use planish::edit::{Edit, Ground, Redo, Undo};
use planish::model::{HistoryEntry, Step};
use planish::observe::Observer;

/// Ways that are kept at most; the oldest goes.
const MOST_BRANCHES: usize = 20;

fn path(steps: &[Step]) -> impl Iterator<Item = HistoryEntry> {
    steps.iter().map(|s| s.entry.clone())
}

/// Edits that two ways have in common from the beginning on.
fn common(a: &[HistoryEntry], b: &[HistoryEntry]) -> usize {
    a.iter().zip(b).take_while(|(a, b)| a == b).count()
}

impl Project {
    /// Keeps what could be made again: the next edit goes another way.
    pub(super) fn fork(&mut self) {
        if self.model.redo.is_empty() {
            return;
        }
        let way: Branch = path(&self.model.undo).chain(self.model.redo.iter().rev().map(|s| s.entry.clone())).collect();
        self.keep_branch(way);
    }

    fn keep_branch(&mut self, way: Branch) {
        // A way that goes on along another holds it.
        self.branches.retain(|b| common(b, &way) < b.len());
        if !self.branches.iter().any(|b| common(b, &way) == way.len()) {
            self.branches.push(way);
        }
        if self.branches.len() > MOST_BRANCHES {
            self.branches.remove(0);
        }
    }

    /// Ways other than that of now.
    pub(super) fn told_branches(&self) -> Vec<state::Branch> {
        let now: Branch = path(&self.model.undo).collect();
        let told = |b: &Branch| {
            let shared = common(b, &now);
            let own = b[shared..].iter().map(|e| e.command.clone()).collect();
            state::Branch { edits: b.len() as u32, own }
        };
        self.branches.iter().map(told).collect()
    }

    /// Goes over to another way: takes back what it has not, and makes its edits.
    /// # Errors
    /// [`Refused`] if one of them cannot be made; those before it are.
    pub(super) fn go_over(&mut self, branch: usize, ground: &Ground, observer: &dyn Observer) -> Result<(), Refused> {
        if branch >= self.branches.len() {
            return Err(Refused::Nothing("there is no such branch"));
        }
        let way = self.branches.remove(branch);
        let now: Branch = path(&self.model.undo).collect();
        let whole: Branch = now.iter().cloned().chain(self.model.redo.iter().rev().map(|s| s.entry.clone())).collect();
        let shared = common(&way, &now);
        let (back, ahead) = (now.len() - shared, way.len() - shared);
        if back > 0 {
            self.edit(&Edit::Undo(Undo { count: back }), Some(ground), observer)?;
        }
        // What is next to be made again may be this very way.
        let next: Vec<HistoryEntry> = self.model.redo.iter().rev().map(|s| s.entry.clone()).collect();
        if ahead > 0 && common(&next, &way[shared..]) == ahead {
            self.edit(&Edit::Redo(Redo { count: ahead }), Some(ground), observer)?;
        } else {
            for entry in &way[shared..] {
                let edit = edit_of(entry).ok_or(Refused::Nothing("an edit of the branch is of another version"))?;
                self.edit(&edit, Some(ground), observer)?;
            }
        }
        if common(&whole, &way) < whole.len() {
            self.keep_branch(whole);
        }
        Ok(())
    }
}

impl<'env> Table<'_, '_, 'env> {
    /// Goes over to another way.
    pub(super) fn branch(&mut self, client: &Client, id: u32, branch: u32) {
        let (Some(project), Some(ground)) = (&mut *self.project, self.ground) else {
            return self.refuse(client, id, Why::of(NO_PROJECT));
        };
        match project.go_over(branch as usize, ground, &planish::Silent) {
            Ok(()) => self.done(client, id, String::new()),
            Err(why) => self.refuse(client, id, Why::of(why)),
        }
        self.after_edit();
    }
}
