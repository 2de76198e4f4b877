#![allow(missing_docs)]
use fleetyard_core::*;
use fleetyard_abi::Task;
use crate::*;
#[derive(Debug)]
pub struct Tasks;
pub struct Assigner { free: Vec<u32>, seed: u64, starts: Vec<u32>, cols: u32 }
impl Assigner {
  pub fn new(grid: &Grid, config: &FleetConfig, _t: Option<&Tasks>) -> Result<Self, FleetError> {
    let free: Vec<u32> = (0..grid.cell_count()).filter(|c| grid.is_passable(*c)).collect();
    let mut keyed: Vec<(u128,u32)> = free.iter().map(|c| { let mut h=Hasher::new("s"); h.u64(config.seed); h.u64(*c as u64); (h.finish().0,*c)}).collect();
    keyed.sort();
    let starts = keyed.iter().take(config.agents as usize).map(|x| x.1).collect();
    Ok(Self{free, seed: config.seed, starts, cols: grid.cols()})
  }
  pub fn starts(&self)->&[u32]{&self.starts}
  pub fn goal(&mut self, agent: usize, index: u32)->u32 { let mut h=Hasher::new("g"); h.u64(self.seed); h.u64(agent as u64); h.u64(index as u64); self.free[(h.finish().0 % self.free.len() as u128) as usize] }
  pub fn upcoming(&mut self, agent: usize, from: u32, cell: u32, window: u32)->Vec<u32>{
    let mut out=vec![]; let mut at=cell; let mut len=0; let mut i=from;
    while out.len()<2 || len<=window { let g=self.goal(agent,i); len+= (g/self.cols).abs_diff(at/self.cols)+(g%self.cols).abs_diff(at%self.cols); at=g; out.push(g); i+=1; }
    out }
  pub fn reached(&mut self, _a: usize, _g: u32){}
  pub fn assign(&mut self, _a: usize, _t: u64)->Result<(),String>{Ok(())}
  pub fn open(&self)->Vec<Task>{vec![]}
  pub fn tasks_done(&self)->Option<u64>{None}
}
