// A kimono in a scene: opens a pack, follows a humanoid's Animator or plays a recorded motion, and fills the meshes every frame.

using System;
using System.IO;
using UnityEngine;

namespace Kitsuke.Unity
{
    /// <summary>Shows a kimono. With a wearer it makes itself a child of the wearer's root, so that both stand in the same space.
    /// It runs in LateUpdate, after Animators and before most else. The Animator has to write the bones in every frame (culling mode
    /// AlwaysAnimate), or limits would be put on top of limits.</summary>
    [AddComponentMenu("Kitsuke/Kimono")]
    [RequireComponent(typeof(MeshFilter), typeof(MeshRenderer))]
    [DefaultExecutionOrder(-100)]
    public sealed class KitsukeBehaviour : MonoBehaviour
    {
        [Header("Kimono")]
        [Tooltip("The pack with the name ending .bytes; or a file's name below.")]
        [SerializeField] private TextAsset pack;
        [Tooltip("A file in StreamingAssets. On Android and WebGL load it with UnityWebRequest and call Open.")]
        [SerializeField] private string packFile = "";
        [Tooltip("The obi's material; without one that of the kimono.")]
        [SerializeField] private Material obiMaterial;

        [Header("Wearer")]
        [SerializeField] private Animator wearer;
        [SerializeField] private TPose tPose = TPose.AtStart;
        [Tooltip("A skirt stops a stride: kimono and wearer are shown in the pose that the kimono allows.")]
        [SerializeField] private bool limit = true;

        [Header("Recorded motion, in the place of the Animator's")]
        [Tooltip("BVH, .vrma … with the name ending .bytes.")]
        [SerializeField] private TextAsset motion;
        [SerializeField] private float speed = 1;

        private Pack opened;
        private Motion playing;
        private GarmentMesh meshes;
        private GameObject obi;
        private Texture2D texture;
        private Material ownMaterial;
        private Wearer wears;
        private double timeS;

        /// <summary>What is shown where there is neither wearer nor motion.</summary>
        public Pose Pose { get; set; }

        /// <summary>The pose in which the kimono was last shown.</summary>
        public Pose Shown { get; private set; }

        /// <summary>The kimono, once there is one: its counts, names and paths.</summary>
        public Pack Pack => opened;

        /// <summary>Seconds into the recorded motion.</summary>
        public double TimeS { get => timeS; set => timeS = value; }

        /// <summary>The wearer, to be set before a pack is opened.</summary>
        public Animator Animator { get => wearer; set => wearer = value; }

        /// <summary>Whether the pose is kept within what the kimono allows.</summary>
        public bool Limit { get => limit; set => limit = value; }

        private void Start()
        {
            if (opened != null) return;
            if (pack != null) Open(pack.bytes);
            else if (packFile != "") Open(File.ReadAllBytes(Path.Combine(Application.streamingAssetsPath, packFile)));
            if (opened != null && motion != null) Play(motion.bytes);
        }

        /// <summary>Opens a pack in the place of what is shown; throws KitsukeException where it cannot be opened.</summary>
        public void Open(ReadOnlySpan<byte> bytes) => Show(Pack.Open(bytes));

        /// <summary>Shows a kimono, for example one that a Fitter made; it is this component's from now on.</summary>
        public void Show(Pack kimono)
        {
            Clear();
            opened = kimono;
            meshes = new GarmentMesh(kimono);
            GetComponent<MeshFilter>().sharedMesh = meshes.Kimono;
            var renderer = GetComponent<MeshRenderer>();
            if (meshes.Obi != null) ShowObi(renderer);
            ShowTexture(kimono.Texture(), renderer);
            if (wearer == null) return;
            transform.SetParent(wearer.transform, false);
            transform.localPosition = Vector3.zero;
            transform.localRotation = Quaternion.identity;
            transform.localScale = Vector3.one;
            wears = new Wearer(kimono, wearer, tPose);
        }

        /// <summary>Plays a recorded motion from its beginning.</summary>
        public void Play(ReadOnlySpan<byte> bytes)
        {
            var read = new Motion(bytes, opened);
            playing?.Dispose();
            playing = read;
            timeS = 0;
        }

        /// <summary>Goes back to the Animator's motion.</summary>
        public void Stop()
        {
            playing?.Dispose();
            playing = null;
        }

        /// <summary>Takes the wearer's T-pose anew; it has to stand in it.</summary>
        public void RecordTPose() => wears?.Record(TPose.AtStart);

        private void LateUpdate()
        {
            if (opened == null) return;
            var pose = Pose;
            if (playing != null)
            {
                pose = playing.PoseAt(timeS, Axes.Unity);
                timeS += Time.deltaTime * (double)speed;
                if (timeS > playing.LengthS) timeS = 0;
            }
            else if (wears != null) pose = wears.Pose();
            if (limit) pose = opened.Limited(Axes.Unity, pose, out _);
            if (playing != null || limit) wears?.Show(pose);
            meshes.Show(pose);
            Shown = pose;
        }

        private void ShowTexture(byte[] png, Renderer renderer)
        {
            if (png.Length == 0) return;
            texture = new Texture2D(2, 2);
            texture.LoadImage(png);
            // The first use makes a copy of the material, which is this component's.
            ownMaterial = renderer.material;
            ownMaterial.mainTexture = texture;
        }

        private void ShowObi(Renderer kimono)
        {
            obi = new GameObject("obi");
            obi.transform.SetParent(transform, false);
            obi.AddComponent<MeshFilter>().sharedMesh = meshes.Obi;
            obi.AddComponent<MeshRenderer>().sharedMaterial = obiMaterial != null ? obiMaterial : kimono.sharedMaterial;
        }

        private void Clear()
        {
            Stop();
            meshes?.Dispose();
            meshes = null;
            opened?.Dispose();
            opened = null;
            wears = null;
            if (obi != null) Destroy(obi);
            if (texture != null) Destroy(texture);
        }

        private void OnDestroy()
        {
            Clear();
            if (ownMaterial != null) Destroy(ownMaterial);
        }
    }
}
