// From the turned bones of any rigged model to poses of a kimono, and back. Knows no engine.

using System.Collections.Generic;

namespace Kitsuke
{
    /// <summary>The bones of VRM 1.0 on a kimono's joints, and how the bones of the model that wears it stand in its T-pose: bones that the
    /// kimono lacks (head, fingers) follow a pose, too. Rotations are the model's: of a bone relative to the model's root, in the axes in
    /// which poses go in.</summary>
    public sealed class Rig
    {
        private readonly List<Bone> bones = new List<Bone>();
        private readonly Bone?[] parents = new Bone?[Kitsuke.Bones.Count];
        private readonly Rotation?[] rest = new Rotation?[Kitsuke.Bones.Count];
        private readonly Rotation[] turned = new Rotation[Kitsuke.Bones.Count];

        public Rig(Pack pack, Axes axes)
        {
            for (var bone = Bone.Hips; (int)bone < Kitsuke.Bones.Count; bone++)
            {
                var joint = pack.Joint(axes, bone);
                if (joint != null && joint.Value.Parent == null) HipsRest = joint.Value.Place;
                bones.Add(bone);
                // What carries a joint of the kimono's is a joint of it; other bones hang on whatever VRM hangs them.
                parents[(int)bone] = joint != null ? joint.Value.Parent : Kitsuke.Bones.Parent(bone);
            }
        }

        /// <summary>The bones of VRM 1.0, parents first.</summary>
        public IReadOnlyList<Bone> Bones => bones;

        /// <summary>Where the kimono's hips rest.</summary>
        public Place HipsRest { get; }

        /// <summary>How a bone of the model stands in the T-pose: the identity where bones are normalised (VRM 0.x, the control rig of
        /// UniVRM); null where the model has no such bone, which then goes along with its parent.</summary>
        public void SetRest(Bone bone, Rotation? rotation) => rest[(int)bone] = rotation;

        /// <summary>Whether the model has this bone.</summary>
        public bool Has(Bone bone) => rest[(int)bone] != null;

        /// <summary>The pose of a model whose bones stand like this now (by the bones' numbers). The kimono's hips go where the model's
        /// are. Bones that the model has between two of the kimono's are in it. Does not allocate.</summary>
        public Pose Pose(Rotation[] now, Place hips)
        {
            var pose = new Pose { HipsTranslation = new Place(hips.X - HipsRest.X, hips.Y - HipsRest.Y, hips.Z - HipsRest.Z) };
            for (var i = 0; i < bones.Count; i++)
            {
                var bone = bones[i];
                var above = Above(bone);
                var at = (int)bone;
                // How far the bone has turned in the model's axes, whatever its own axes are.
                turned[at] = rest[at] is Rotation stood ? now[at] * stood.Inverse : above;
                pose[bone] = above.Inverse * turned[at];
            }
            return pose;
        }

        /// <summary>How the model's bones have to stand in a pose. Returns where its hips have to be. Does not allocate.</summary>
        public Place Stand(Pose pose, Rotation[] now)
        {
            for (var i = 0; i < bones.Count; i++)
            {
                var at = (int)bones[i];
                turned[at] = Above(bones[i]) * pose[bones[i]];
                if (rest[at] is Rotation stood) now[at] = turned[at] * stood;
            }
            var way = pose.HipsTranslation;
            return new Place(HipsRest.X + way.X, HipsRest.Y + way.Y, HipsRest.Z + way.Z);
        }

        private Rotation Above(Bone bone)
        {
            var parent = parents[(int)bone];
            return parent == null ? Rotation.Identity : turned[(int)parent.Value];
        }
    }
}
