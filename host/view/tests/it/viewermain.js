import { bytesOf } from './base64.js';
import { Bodies } from './bodies.js';
import { Cells } from './cells.js';
import { decode } from './clip.js';
import { Clock } from './clock.js';
import { Fleet } from './fleet.js';
import { Clips } from './motion.js';
import { Recording } from './recording.js';
import { Scene } from './scene.js';
import { Stage } from './stage.js';

globalThis.viewer = { bytesOf, Bodies, Cells, Clips, Clock, Fleet, Recording, Scene, Stage, decode };
